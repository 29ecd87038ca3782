"""The recorder, through real drivers and pseudo-terminals, on the emulated rig, whose truth is known."""

import os
import signal
import threading
import time

import numpy as np
import pytest
import trimesh
from recording_examples import plan_document, recorder

from tacdata.errors import DeviceError
from tacdata.plans import Plan
from tacdata.recording.check.report import check
from tacdata.recording.episode import PHASES
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.interruption import Interruption
from tacdata.rig import read_rig
from tacdata.surfaces import distance_grid


class Truth:
    """Where the carriage really was, sampled while the rig runs."""

    def __init__(self, rig):
        self.rig, self.times, self.positions = rig, [], []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def _watch(self):
        while not self._stop.wait(0.002):
            now = self.rig.clock.now_ns() - 5_000_000
            self.times.append(now)
            self.positions.append(self.rig.controller.position_at(now).copy())

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._stop.set()
        self._thread.join()


def amiss(report):
    """Return what makes a session unusable, but for a depth not known since this machine stood still: ten times as long
    for the rig."""
    depth = "while pressing is uncertain by"
    return [f.text for f in report.findings if f.severity == "unusable" and depth not in f.text]


@pytest.mark.parametrize("where", ["finalizer", "lock"])
def test_ctrl_c_where_python_would_lose_it_stops_the_recording(virtual, tmp_path, where):
    """In a finalizer it is ignored; amid the taking of a lock again it becomes a RuntimeError of the lock's."""

    class Finalized:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)

    class Contended(threading.Condition):
        def _acquire_restore(self, state):
            os.kill(os.getpid(), signal.SIGINT)
            super()._acquire_restore(state)

    def stop(*progress):
        if where == "finalizer":
            Finalized()
        else:
            contended = Contended(threading.Lock())
            with contended:
                contended.wait(0.01)

    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        recorder(virtual, tmp_path / "session", progress=stop, interruption=interruption).run(lambda summary: True)
    assert len(file_names.finished(tmp_path / "session")) == 1


def test_two_presses_agree_with_what_really_happened(virtual, tmp_path):
    with Truth(virtual) as truth:
        session = recorder(virtual, tmp_path / "session").run(lambda summary: True)
    times, positions = np.array(truth.times), np.array(truth.positions)
    registration = read_rig(virtual.path).registration
    timing = virtual.board.timing
    assert len(session.episodes) == 2
    for path in session.episodes:
        recording = read_recording(path)
        episode = recording.episode
        assert episode.complete
        assert recording.counts["taxels"]["lost"] == 0
        assert (np.diff(episode.taxels.counter) == 1).all()
        # Late by the link's least delay, which the fast clock multiplies; never early, never adrift.
        device = np.array([timing.sample_ns(int(k)) for k in episode.taxels.counter])
        error = (episode.taxels.sample_ns - device) / 1e6 / virtual.clock.rate
        assert -0.5 < error.min()
        assert error.max() < 10.0, "milliseconds of real time"
        assert np.ptp(error) < 1.0
        # The nominal depth against the carriage's, on the rig's own clock, while the indenter is loaded.
        inside = (times > episode.tip_ns[0]) & (times < episode.tip_ns[-1])
        real = registration.to_sensor(positions[inside])
        nominal = episode.tip_at(times[inside])
        loaded = real[:, 2] > 0.0
        # A busy machine looks rarely; the pose is compared wherever it looked, and the hold below must be among that.
        assert loaded.sum() >= 5
        slack = max(m.uncertainty_ns for m in recording.moves if m.command.phase in ("press", "release"))
        assert np.abs(nominal - real)[loaded].max() < 1.0 * slack * 1e-9 + 0.01
        assert real[:, 2].max() == pytest.approx(episode.press.depth, abs=0.006)
    assert not amiss(check(tmp_path / "session"))


def test_strokes_are_recorded_and_the_controller_is_not_accused_of_standing_still(virtual, tmp_path):
    """A report is too rare to show the end of each: the answer to the pause behind it does."""
    document = plan_document(1)
    document["presses"] = [{**document["presses"][0], "speed": 6.0, "strokes": 12, "stroke": 0.2}]
    strokes = Plan.from_document(document, "strokes")
    session = recorder(virtual, tmp_path / "session", plan=strokes).run(lambda summary: True)
    recording = read_recording(session.episodes[0])
    depth = recording.episode.tip[:, 2]
    turns = (depth[1:-1] < depth[:-2] - 1e-9) & (depth[1:-1] <= depth[2:])
    assert np.count_nonzero(turns & np.isclose(depth[1:-1], 0.6, atol=1e-3)) == 12
    assert depth.max() == pytest.approx(0.8, abs=1e-3)
    assert [p.name for p in recording.episode.phases] == list(PHASES)
    assert not amiss(check(tmp_path / "session"))


def test_solids_from_files_are_pressed_like_any_other(virtual, tmp_path, monkeypatch):
    # A coarse grid of distances; no other test presses this ball, so that none finds it in the cache.
    monkeypatch.setattr(distance_grid, "NODES", 100_000)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=2.03)
    ball.apply_translation([0, 0, 7.5])
    document = plan_document(3)
    document["indenters"] = {}
    for press, ending in zip(document["presses"], ("stl", "ply", "obj"), strict=True):
        ball.export(tmp_path / f"ball.{ending}")
        press["indenter"] = ending
        document["indenters"][ending] = {"shape": "mesh", "file": f"ball.{ending}"}
    session = recorder(virtual, tmp_path / "session", plan=Plan.from_document(document, "solids", tmp_path)).run(
        lambda summary: True
    )
    assert len(session.episodes) == 3
    for path in session.episodes:
        episode = read_recording(path).episode
        counts, phase = episode.taxels.counts, episode.phase_at(episode.taxels.sample_ns)
        answer = counts[phase == PHASES.index("hold")].mean(axis=0) - counts[phase == PHASES.index("rest")].mean(axis=0)
        assert answer.max() > 100, "the world felt the solid"
    assert not amiss(check(tmp_path / "session"))


def test_an_alarm_in_mid_press_leaves_a_readable_file_and_a_session_to_resume(virtual, tmp_path):
    out = tmp_path / "session"
    with pytest.raises(DeviceError, match=r"(?i)alarm"):
        recorder(virtual, out, progress=lambda *_: strike(virtual, out)).run(lambda summary: True)
    assert list(file_names.finished(out)) == [0]
    (broken,) = file_names.unfinished(out)
    episode = read_recording(broken).episode
    assert not episode.complete
    assert any("broken off" in note for note in episode.notes)
    assert not any("contradict" in note for note in episode.notes)
    assert len(episode.taxels.counter) > 5


def height(virtual):
    """Height of the tip 5 ms ago [mm]."""
    return virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000)[2]


def strike(virtual, out):
    """Send an alarm when the second press is on the skin."""
    surface = read_rig(virtual.path).registration.origin[2]

    def later():
        while not file_names.finished(out) or height(virtual) > surface - 0.2:
            time.sleep(0.002)
        virtual.controller.inject_alarm(1)

    threading.Thread(target=later, daemon=True).start()


def test_ctrl_c_on_the_skin_lifts_the_indenter(virtual, tmp_path):
    out = tmp_path / "session"
    surface = read_rig(virtual.path).registration.origin[2]

    def interrupt_on_the_skin():
        while height(virtual) > surface - 0.2:
            time.sleep(0.002)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt_on_the_skin, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        recorder(virtual, out).run(lambda summary: True)
    assert height(virtual) == pytest.approx(surface + 3.0, abs=0.01)
    (broken,) = file_names.unfinished(out)
    episode = read_recording(broken).episode
    assert any("Ctrl-C" in note for note in episode.notes)
    assert any("lifted off the skin" in note for note in episode.notes)
    assert not any("contradict" in note for note in episode.notes)
    session = recorder(virtual, out, resume=True).run(lambda summary: True)
    assert len(session.episodes) == 2
