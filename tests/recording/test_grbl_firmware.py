"""Driver and recorder against the emulated firmware and a real one (see docs/how_to/testing_with_firmware.md).

For a real one, run with ``TACDATA_GRBL_FIRMWARE='PATH/TO/grblHAL_sim -n -s /dev/null -b /dev/null'``.
"""

import os
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from device_doubles import Board
from firmware_process import EmulatedFirmware, Firmware, tell
from recording_examples import SENSOR, plan, rig

from tacdata.clock import Clock
from tacdata.devices.grbl import Grbl
from tacdata.errors import DeviceError
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder

COMMAND = os.environ.get("TACDATA_GRBL_FIRMWARE", "")
pytestmark = pytest.mark.long(
    "tacdata/devices", "tacdata/recording", "tacdata/wire", "tacdata/virtual_rig", reason="a firmware, in its own time"
)
START = (10.0, 20.0, -20.0)
SET_UP = (
    "$X",
    "$1=255",
    "$10=1",
    "$20=0",
    "$22=0",
    "$100=250",
    "$101=250",
    "$102=250",
    "$110=3000",
    "$111=3000",
    "$112=900",
    "$120=200",
    "$121=200",
    "$122=150",
    "G53G90G94G21G1X10Y20Z-20F3000",
    "G4P0.01",
)

REAL = pytest.param("real", marks=pytest.mark.skipif(not COMMAND, reason="TACDATA_GRBL_FIRMWARE names no firmware"))


@pytest.fixture(params=["emulated", REAL])
def firmware(request, tmp_path):
    process = Firmware(COMMAND, tmp_path) if request.param == "real" else EmulatedFirmware()
    yield process
    process.close()


@pytest.fixture
def ready(firmware):
    tell(firmware.path, *SET_UP)
    return firmware


class Reported(Grbl):
    """Tells the doubled board where the machine is."""

    def position(self, time_ns=None):
        last = self._link.last if self._link else None
        return np.zeros(3) if last is None else last.position


def claimed(recording):
    """Return what the nominal path may be off each report [mm], by the uncertainties of both, shape (n,)."""
    stream = recording.episode.cnc
    allowed = np.full(len(stream.sample_ns), recording.height_resolution + 0.0025)  # the steps of a ramp lie unevenly
    half = stream.arrival_ns - stream.sample_ns
    for move in recording.moves:
        slack = move.uncertainty_ns + move.contradiction_ns + half
        at = (stream.sample_ns > move.start_ns - slack) & (stream.sample_ns < move.end_ns + slack)
        allowed[at] = np.maximum(allowed, recording.height_resolution + 0.0025 + slack * 1e-9 * move.profile.peak)[at]
    return allowed


def test_a_fresh_memory_is_survived_and_everything_is_read(firmware):
    with Grbl(Clock.start(), firmware.path) as driver:
        said, cautions = driver.settings(), driver.cautions
        driver.move((0.5, 0.0, -0.5), 2.0)
        driver.wait_idle(60)
        np.testing.assert_allclose(driver.statuses()[-1].position, [0.5, 0, -0.5], atol=0.005)
    assert {"VER", "OPT", "GC", "G54", "G92", "$100", "$132", "banner"} <= set(said)
    assert "touch off before moving" in cautions[0] or said["reset_at_opening"] == "no"


def test_a_dwell_is_answered_when_the_move_before_it_has_ended(ready):
    with Grbl(Clock.start(), ready.path) as driver:
        for k in range(4):
            target = (10.0, 20.0, -20.0 + 0.5 * (k % 2))
            driver.move(target, 5.0)
            driver.dwell(0.01)
            last = driver._opened().fresh_status(30)
            assert last.state == "Idle"
            np.testing.assert_allclose(last.position, target, atol=0.005)


def test_a_hold_in_mid_move_and_a_retract(ready):
    with Grbl(Clock.start(), ready.path) as driver:
        driver.move((10.0, 20.0, -40.0), 2.0)
        threading.Timer(1.0, driver.feed_hold).start()
        with pytest.raises(DeviceError, match="feed hold"):
            driver.dwell(0.01)
        x, y, z = driver.abandon()
        assert -40 < z < -20
        assert (x, y) == pytest.approx((10, 20), abs=0.005)
        driver.move((x, y, -19.0), 5.0)
        driver.wait_idle(60)
        np.testing.assert_allclose(driver.statuses()[-1].position, [10, 20, -19], atol=0.005)


def test_refused_lines_and_a_queue_longer_than_the_planner(ready):
    with Grbl(Clock.start(), ready.path) as driver:
        with pytest.raises(DeviceError, match="error:"):
            driver._opened().command("G77X1", 10)
        driver.feed_hold()
        driver.abandon()
        for k in range(120):
            driver.move((10.0 + 0.02 * (k % 2), 20.0, -20.0), 20.0)
        driver.wait_idle(120)
        driver.check()


def test_a_reset_by_somebody_else_means_position_lost(ready):
    with Grbl(Clock.start(), ready.path) as driver:
        driver.move((10.0, 20.0, -40.0), 2.0)
        driver._opened().port.write(b"\x18")
        with pytest.raises(DeviceError, match=r"ALARM:3|position is lost|locked"):
            driver.dwell(0.01)
        with pytest.raises(DeviceError):
            driver.abandon()


def session(firmware, folder, presses=1, **changes):
    clock = Clock.start()
    cnc = Reported(clock, firmware.path)
    bench = replace(rig(), clock=clock)
    return Recorder(
        bench,
        SENSOR,
        plan(presses, hold=0.3, rest=0.4),
        folder,
        mount=lambda press: None,
        ask=lambda question: True,
        devices=RigDevices(cnc, Board(clock, cnc), {}),
        **changes,
    )


def test_a_session_whose_nominal_path_agrees_with_the_reports(ready, tmp_path):
    recorded = session(ready, tmp_path / "session", presses=2).run(lambda summary: True)
    assert len(recorded.episodes) == 2
    for path in recorded.episodes:
        recording = read_recording(path)
        episode = recording.episode
        assert episode.complete
        assert episode.tip[:, 2].max() == pytest.approx(episode.press.depth, abs=0.003)
        inside = (episode.cnc.sample_ns > episode.tip_ns[0]) & (episode.cnc.sample_ns < episode.tip_ns[-1])
        reported = rig().registration.to_sensor(episode.cnc.position[inside])
        nominal = episode.tip_at(episode.cnc.sample_ns[inside])
        near = reported[:, 2] > -1.0
        assert near.sum() > 5
        allowed = claimed(recording)[inside]
        assert (np.abs(nominal - reported).max(axis=1) < allowed)[near].all()


def test_a_fault_in_mid_press_stops_and_lifts_straight_up(ready, tmp_path):
    recorder = session(ready, tmp_path / "session")
    board, told = recorder.devices.board, []

    def pull():
        while recorder.devices.cnc.position()[2] > -30.3:
            time.sleep(0.005)
        told.append(time.monotonic_ns())
        board.broken = DeviceError("the taxel board's cable was pulled", "a cable", "plug it in")

    threading.Thread(target=pull, daemon=True).start()
    with pytest.raises(DeviceError, match="cable was pulled"):
        recorder.run(lambda summary: True)
    assert ready.when(0x21) - told[0] < 250_000_000
    (broken,) = file_names.unfinished(tmp_path / "session")
    notes = " ".join(read_recording(broken).episode.notes)
    assert "straight up" in notes
    with Grbl(Clock.start(), ready.path) as driver:
        z = driver._opened().fresh_status(30).position[2]
    assert z == pytest.approx(-27.0, abs=0.005)
