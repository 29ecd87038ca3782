"""The constant delays from a few touches, where the truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from recording_examples import SENSOR, plan, plan_document, rig_document
from sync_tap_example import CAMERA_DELAY, Tap

from tacdata.errors import UsageError
from tacdata.plans import Plan
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.files.reader import read_recording
from tacdata.recording.motion import sync_tap
from tacdata.recording.recorder import Recorder
from tacdata.recording.session import create_session, read_session, refresh, resume_session
from tacdata.recording.sync_tap import delays
from tacdata.recording.sync_tap.session_delays import add_sync, changes, latencies
from tacdata.rig import read_rig
from tacdata.virtual_rig.rig import VirtualRig
from tacdata.virtual_rig.world.mounting import mount

MS = 1e6


HALF_A_MINUTE = pytest.mark.long("tacdata/recording", "tacdata/virtual_rig", reason="a rig at its own speed, 30 s each")


@pytest.mark.parametrize(
    ("rate", "delay", "timer", "limit"),
    [
        (30.0, 0.1, 0.016, 3.0),
        pytest.param(100.0, 0.02, 0.001, 1.0, marks=HALF_A_MINUTE),
        pytest.param(100.0, 0.02, 0.016, 2.0, marks=HALF_A_MINUTE),
    ],
)
def test_sample_times_on_the_emulated_rig_agree_with_its_truth(tmp_path, rate, delay, timer, limit):
    """At 100 Hz behind a 16 ms timer, frames sit on every eighth of it: 2 ms of drift pass before any is seen."""
    sensor = replace(SENSOR, taxels=replace(SENSOR.taxels, rate=rate))
    virtual = VirtualRig(tmp_path / "rig", 1.0, seed=1, camera=False, sensor=sensor)
    virtual.board.timing = replace(virtual.board.timing, conversion=delay, timer=timer)
    virtual.start()
    try:
        rig = read_rig(virtual.path)
        session = Recorder(
            rig,
            sensor,
            plan(1),
            tmp_path / "session",
            sync_tap=True,
            mount=lambda press: mount(rig.document, press.indenter.document, press.yaw),
        ).run(lambda summary: "sync tap" in summary.text)
    finally:
        virtual.stop()
    assert set(latencies(read_session(session.folder))) == {"taxels"}
    taxels = read_recording(session.episodes[0]).episode.taxels
    true = np.array([virtual.board.timing.sample_ns(int(k)) for k in taxels.counter])
    assert ((taxels.arrival_ns - true) / MS).min() > 1e3 * delay
    assert np.abs((taxels.sample_ns - true) / MS).max() < limit


@pytest.mark.parametrize(
    ("rate", "delay", "timer", "limit"),
    [(30.0, 0.002, 0.0, 3.0), (30.0, 0.1, 0.016, 3.0), (100.0, 0.03, 0.0, 1.0), (100.0, 0.1, 0.0, 1.0)],
)
@pytest.mark.parametrize("seed", [0, 4])
def test_sample_times_are_right_after_a_sync_tap(tmp_path, rate, delay, timer, limit, seed):
    tap = Tap(seed, rate, delay, timer)
    recording = read_recording(tap.write(tmp_path / "sync_tap-000.mcap"))
    raw = (recording.episode.taxels.sample_ns - tap.true) / MS
    assert np.abs(raw).min() > 0.9 * delay * 1e3, "without the tap the constant delay stays"
    latency = delays.taxel_latency(recording)
    assert isinstance(latency, StreamLatency), latency
    error = raw - latency.latency_ns / MS
    assert np.abs(error).max() < limit
    assert np.abs(error.mean()) < 4 * latency.uncertainty_ns / MS + 0.3, "what is said of the error is about right"


def test_a_slow_machine_will_do(tmp_path):
    tap = Tap(1, 30.0, 0.02, acceleration=15.0)
    recording = read_recording(tap.write(tmp_path / "sync_tap-000.mcap"))
    latency = delays.taxel_latency(recording)
    assert isinstance(latency, StreamLatency), latency
    assert np.abs((recording.episode.taxels.sample_ns - latency.latency_ns - tap.true) / MS).max() < 3.0


def test_a_camera_is_matched_by_the_motion_of_its_tag(tmp_path):
    tap = Tap(2, camera=True)
    found = delays.measure(read_recording(tap.write(tmp_path / "sync_tap-000.mcap")))
    assert set(found.latencies) == {"taxels", "camera side"}
    latency = found.latencies["camera side"]
    assert latency.latency_ns / 1e9 == pytest.approx(CAMERA_DELAY, abs=0.003)
    assert latency.uncertainty_ns < 3 * MS
    assert len(found.words) == 2


def test_touches_that_were_not_felt_give_words_and_no_delay(tmp_path):
    tap = Tap(3)
    tap.counts = np.round(9000 + tap.rng.normal(0, 5, tap.counts.shape))
    found = delays.measure(read_recording(tap.write(tmp_path / "sync_tap-000.mcap")))
    assert found.latencies == {}
    assert "touch deeper" in found.remarks[0]


def test_dead_and_undefined_channels_do_not_matter(tmp_path):
    tap = Tap(4)
    tap.counts[:, 3], tap.counts[:, 20] = np.nan, 65535.0
    latency = delays.taxel_latency(read_recording(tap.write(tmp_path / "sync_tap-000.mcap")))
    assert isinstance(latency, StreamLatency)
    assert latency.latency_ns / MS == pytest.approx(6.0, abs=1.0)


def test_touches_are_no_deeper_than_the_plan_and_lie_on_a_taxel():
    press = sync_tap.touch(plan(2), SENSOR)
    assert press.depth == sync_tap.DEPTH
    assert [press.x, press.y] in SENSOR.taxels.centers.tolist()
    shallow = plan_document(1)
    shallow["presses"][0]["depth"] = 0.25
    assert sync_tap.touch(Plan.from_document(shallow, "p"), SENSOR).depth == 0.25
    shallow["presses"][0]["depth"] = -0.5
    with pytest.raises(UsageError, match="sync tap"):
        sync_tap.touch(Plan.from_document(shallow, "p"), SENSOR)


def test_the_session_keeps_the_delays_and_says_when_they_change(tmp_path):
    session = before = create_session(tmp_path / "session", plan(1), SENSOR, rig_document())
    assert latencies(session) == {}
    first = delays.SyncTap({"taxels": StreamLatency(6_000_000, 300_000)}, ("camera side: no tag",))
    session = add_sync(session, tmp_path / "sync_tap-000.mcap", first)
    assert latencies(read_session(session.folder)) == first.latencies
    assert changes(session, {"taxels": StreamLatency(6_500_000, 300_000)}) == ()
    (words,) = changes(session, {"taxels": StreamLatency(16_000_000, 300_000)})
    assert "+10.0 ms" in words
    kept = json.loads((session.folder / "session.json").read_text())["sync"][0]
    assert kept["remarks"] == ["camera side: no tag"]
    # The recorder looks at the folder again at its end, whatever it knew at its beginning.
    assert latencies(refresh(before)) == first.latencies
    resumed = resume_session(session.folder, plan(1), SENSOR, rig_document())
    assert latencies(resumed) == first.latencies
