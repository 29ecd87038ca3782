"""The clock of a virtual rig waits for its devices, so that a busy computer loses nothing."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from tacdata import paced_host
from tacdata.clock import Clock
from tacdata.devices.device import MotionController, TaxelBoard, create
from tacdata.errors import UsageError
from tacdata.paced_host import LONGEST_NS, SLACK_NS, PacedHost
from tacdata.rig import read_rig

MS = 1_000_000


@pytest.fixture
def real(monkeypatch):
    """Time of the computer [ns], in a list of one entry."""
    instant = [1_000_000 * MS]
    monkeypatch.setattr(paced_host.time, "monotonic_ns", lambda: instant[0])
    return instant


def test_time_runs_as_the_computers_while_devices_are_served(tmp_path, real):
    host = PacedHost(tmp_path / "pace", new=True)
    for _ in range(100):
        assert host.monotonic_ns() == real[0]
        host.serve("board", host.monotonic_ns() + 20 * MS)
        real[0] += 20 * MS
    assert host.waited == 0.0


def test_time_waits_for_the_latest_device_and_goes_on_without_a_step(tmp_path, real):
    host = PacedHost(tmp_path / "pace", new=True)
    begin = real[0]
    host.serve("board", begin + 10 * MS)
    host.serve("controller", begin + 500 * MS)
    real[0] += 3000 * MS
    assert host.monotonic_ns() == begin + 10 * MS + SLACK_NS
    host.serve("board", host.monotonic_ns() + 10 * MS)
    assert host.monotonic_ns() == begin + 10 * MS + SLACK_NS
    real[0] += 5 * MS
    assert host.monotonic_ns() == begin + 15 * MS + SLACK_NS
    assert host.waited == pytest.approx(3.0 - 0.01 - SLACK_NS * 1e-9)


def test_time_does_not_wait_for_a_device_that_has_ended(tmp_path, real):
    host = PacedHost(tmp_path / "pace", new=True)
    host.serve("board", real[0])
    host.serve("board", None)
    real[0] += 3000 * MS
    assert host.monotonic_ns() == real[0]


def test_time_goes_on_without_a_device_that_hangs(tmp_path, real):
    host = PacedHost(tmp_path / "pace", new=True)
    begin = real[0]
    host.serve("board", begin)
    real[0] += SLACK_NS + LONGEST_NS + 700 * MS
    assert host.monotonic_ns() == begin + SLACK_NS + 700 * MS
    host.serve("board", host.monotonic_ns())
    assert host.monotonic_ns() == begin + SLACK_NS + 700 * MS


def test_a_recorder_reads_the_time_of_the_rig(tmp_path, real):
    host = PacedHost(tmp_path / "pace", new=True)
    clock = Clock.start(8.0, host)
    host.publish()
    recorder = Clock.from_document(clock.document)
    shown = clock.now_ns()
    clock.serve("board", shown + 80 * MS)
    for step in (5, 4000, 3):
        real[0] += step * MS
        assert recorder.now_ns() == clock.now_ns()
        assert recorder.now_ns() <= shown + 80 * MS + 8 * SLACK_NS + 8
    clock.serve("board", clock.now_ns() + 80 * MS)
    real[0] += 7 * MS
    assert recorder.now_ns() == clock.now_ns() == shown + 80 * MS + 8 * SLACK_NS + 56 * MS


def test_a_clock_whose_rig_has_ended_is_refused(tmp_path):
    clock = Clock.from_document({"epoch_ns": 0, "origin_ns": 0, "rate": 8.0, "pace": str(tmp_path / "pace")})
    with pytest.raises(UsageError, match="has ended"):
        clock.now_ns()


def test_nothing_is_lost_while_the_rig_does_not_run(tmp_path):
    command = [sys.executable, "-m", "tacdata.cli", "virtual-rig", str(tmp_path), "--speed", "8", "--no-camera"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        while not (tmp_path / "rig.yaml").exists() and process.poll() is None:
            time.sleep(0.05)
        rig = read_rig(tmp_path / "rig.yaml")
        cnc = create(rig.cnc, MotionController, rig.clock)
        board = create(rig.board, TaxelBoard, rig.clock)
        with cnc, board:
            up = rig.registration.to_machine(0.0, 0.0, -4.0)
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(6.0)  # a controller that is silent for 5 s is given up
            stopped = rig.clock.now_ns()
            time.sleep(0.2)
            assert rig.clock.now_ns() == stopped
            os.kill(process.pid, signal.SIGCONT)
            cnc.move(up, 25.0)
            cnc.wait_idle(20)
            board.read(1.0)
            place, counts = cnc.statuses()[-1].position, board.counts
    finally:
        os.kill(process.pid, signal.SIGCONT)
        process.terminate()
        words, _ = process.communicate(timeout=60)
    np.testing.assert_allclose(place, up, atol=0.01)
    assert (counts.lost, counts.corrupt) == (0, 0)
    assert "too busy for --speed 8" in words
