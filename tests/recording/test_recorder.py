import math
import multiprocessing
import os
import signal
import threading
from concurrent.futures import Future
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from device_doubles import Board, Controller, Eye
from recording_examples import SENSOR, plan, rig

from tacdata import documents
from tacdata.clock import Clock
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.recording import read_session
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.detection_process import in_background
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder

SPEED = 10.0
PRESS = 9  # the move that presses in the second episode: 5 moves in the first, then travel, approach, press
HEIGHT = -27.0
POSE = SimpleNamespace(position=(0, 0, 0.4), quaternion=(0, 0, 0, 1), reprojection=0.1, faces=2)


def found(*_):
    search = Future()
    search.set_result(POSE)
    return search


class Bench:
    """A rig in memory and a recorder on it."""

    def __init__(self, folder, presses=2, camera=False, at=(10.0, 20.0, -20.0)):
        self.folder, self.clock, self.camera = folder, Clock.start(SPEED), camera
        self.rig = replace(rig(camera=camera), clock=self.clock)
        self.plan = plan(presses, hold=0.3, rest=0.4)
        self.cnc = Controller(self.clock, at)
        self.board = Board(self.clock, self.cnc)
        self.mounted, self.progress = [], []

    def recorder(self, resume=False, **changes):
        cameras = {"side": Eye(self.clock)} if self.camera else {}
        return Recorder(
            changes.get("rig", self.rig),
            SENSOR,
            changes.get("plan", self.plan),
            self.folder,
            resume=resume,
            devices=RigDevices(self.cnc, self.board, cameras),
            mount=self.mounted.append,
            detect=changes.get("detect", found),
            progress=lambda *values: self.progress.append(values),
        )

    def run(self, **changes):
        return self.recorder(**changes).run(lambda summary: True)


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path / "session")


def moves(calls):
    return [call[1] for call in calls if call[0] == "move"]


def test_presses_are_recorded_one_file_each(tmp_path):
    bench = Bench(tmp_path / "session", camera=True)
    session = bench.run()
    assert [path.name for path in session.episodes] == ["episode-000000.mcap", "episode-000001.mcap"]
    assert session.remaining == ()
    assert len(session.document["episodes"]) == 2
    assert len(bench.mounted) == 1, "one indenter at one angle is mounted once"
    assert [p[:2] for p in bench.progress] == [(1, 2), (2, 2)]
    for path, press in zip(session.episodes, bench.plan.presses, strict=True):
        recording = read_recording(path)
        episode = recording.episode
        assert episode.complete, episode.notes
        assert episode.press == press
        assert [p.name for p in episode.phases] == ["rest", "approach", "press", "hold", "release"]
        assert episode.tip[:, 2].max() == pytest.approx(press.depth, abs=1e-6)
        hold = episode.phases[3]
        middle = np.array([(hold.start_ns + hold.end_ns) // 2])
        np.testing.assert_allclose(episode.tip_at(middle)[0], [press.x, press.y, press.depth], atol=1e-6)
        assert (np.diff(episode.taxels.counter) == 1).all()
        # The bench's clock runs SPEED times too fast, and so do this host's stalls: the clock fit has tests of its own.
        assert np.diff(episode.taxels.sample_ns).mean() == pytest.approx(33_333_333, rel=1e-2)
        pressed = episode.taxels.counts[episode.phase_at(episode.taxels.sample_ns) == 3]
        assert pressed.mean() - 9000 == pytest.approx(800 * press.depth, rel=0.05)
        assert recording.images["side"] > 10
        assert (episode.tags[0].faces == 2).all()
    assert bench.cnc.calls[-1] == "close"
    assert "feed_hold" not in bench.cnc.calls


def test_a_detector_that_fails_costs_the_poses_only(tmp_path):
    def broken(*_):
        search = Future()
        search.set_exception(RuntimeError("no libraries"))
        return search

    bench = Bench(tmp_path / "session", presses=1, camera=True)
    session = bench.run(detect=broken)
    recording = read_recording(session.episodes[0])
    assert recording.episode.complete
    assert recording.images["side"] > 10
    assert len(recording.episode.tags[0].faces) == 0


def test_the_detection_process_answers_and_ends():
    with in_background(math.hypot) as detect:
        assert detect(3.0, 4.0).result(timeout=60) == 5.0
    assert multiprocessing.active_children() == []


def test_nothing_moves_without_a_yes(bench):
    seen = []
    with pytest.raises(UsageError, match="not confirmed"):
        bench.recorder().run(lambda summary: seen.append(summary) or False)
    assert moves(bench.cnc.calls) == []
    assert not bench.folder.exists()
    summary = seen[0]
    assert (summary.presses, summary.total) == (2, 2)
    assert summary.deepest == pytest.approx(0.82)
    assert "machine bounds" in summary.text
    assert "first move: straight up, to -27.00 mm or more; see that up is free" in summary.text
    assert summary.lower[2] == pytest.approx(-30.82)


def test_a_press_outside_the_envelope_is_refused_before_the_first_move(bench):
    narrow = {**bench.rig.document["envelope"], "min": [0.0, 5.0, -30.5]}
    document = {**bench.rig.document, "envelope": narrow}
    from tacdata.rig.rig import from_document

    with pytest.raises(FormatError, match="presses/0 needs machine position"):
        bench.run(rig=replace(from_document(document, "bench"), clock=bench.clock))
    assert moves(bench.cnc.calls) == []
    assert not bench.folder.exists()


def test_a_guide_outside_the_envelope_or_below_the_skin_is_not_dragged_across(tmp_path):
    low = Bench(tmp_path / "low", presses=1, at=(12.0, 22.0, -29.9))
    low.run()
    assert moves(low.cnc.calls)[0] == (12.0, 22.0, HEIGHT), "straight up first"
    outside = Bench(tmp_path / "out", presses=1, at=(100.0, 20.0, -20.0))
    with pytest.raises(DeviceError, match="outside the envelope"):
        outside.run()
    assert moves(outside.cnc.calls) == []


def test_an_existing_folder_is_refused_and_left_alone(bench):
    bench.folder.mkdir()
    (bench.folder / "thesis.txt").write_text("precious")
    with pytest.raises(UsageError, match="exists"):
        bench.run()
    assert [p.name for p in bench.folder.iterdir()] == ["thesis.txt"]
    assert bench.cnc.calls == []


def break_board(bench):
    def fault():
        bench.at_fault = len(bench.cnc.calls)
        bench.board.broken = DeviceError("the line to the taxel board broke", "a port", "check the cable")

    return fault


def interrupt(bench):
    def fault():
        bench.at_fault = len(bench.cnc.calls)
        os.kill(os.getpid(), signal.SIGINT)

    return fault


@pytest.mark.parametrize("kind", [break_board, interrupt])
def test_a_fault_in_mid_press_stops_the_motion_first(bench, kind):
    bench.cnc.fault_at, bench.cnc.on_fault = PRESS - 1, kind(bench)
    with pytest.raises((DeviceError, KeyboardInterrupt)):
        bench.run()
    after = [call for call in bench.cnc.calls[bench.at_fault :] if call[0] != "dwell"]
    assert after[0] == "feed_hold", "the motion stops before anything else"
    rest = [call for call in after if call != "feed_hold"]
    assert rest[0] == "abandon"
    ((_, lifted),) = rest[1:-1]
    assert lifted[2] == HEIGHT, "then the indenter leaves the skin, straight up"
    assert rest[-1] == "close"
    assert list(file_names.finished(bench.folder)) == [0]
    (broken,) = file_names.unfinished(bench.folder)
    assert broken.name == "episode-000001.interrupted-0.mcap"
    episode = read_recording(broken).episode
    assert not episode.complete
    assert any("broken off" in note for note in episode.notes)
    assert any("lifted off the skin" in note for note in episode.notes)
    assert len(episode.taxels.counter) > 20
    assert episode.tip[:, 2].max() < 0.82, "the path is where the guide was, not where it was sent"


def test_resuming_goes_on_with_the_next_press(bench):
    bench.cnc.fault_at, bench.cnc.on_fault = PRESS - 1, break_board(bench)
    with pytest.raises(DeviceError, match="taxel board broke"):
        bench.run()
    first = (bench.folder / "episode-000000.mcap").read_bytes()
    again = Bench(bench.folder)
    with pytest.raises(UsageError, match="exists"):
        again.run()
    session = again.run(resume=True)
    assert [p.name for p in session.episodes] == ["episode-000000.mcap", "episode-000001.mcap"]
    assert len(session.unfinished) == 1
    assert (bench.folder / "episode-000000.mcap").read_bytes() == first
    assert len(moves(again.cnc.calls)) == 5
    assert again.run(resume=True).remaining == ()
    assert len(moves(again.cnc.calls)) == 5, "nothing left to do, nothing moves"


def test_what_a_kill_left_is_put_aside_on_resuming(bench):
    bench.run()
    partial = file_names.partial(bench.folder / "episode-000001.mcap")
    (bench.folder / "episode-000001.mcap").rename(partial)
    partial.write_bytes(partial.read_bytes()[:-2000])  # one that is whole would get its name
    with pytest.raises(FormatError, match=r"names episode-000001\.mcap"):
        read_session(bench.folder)
    document = documents.read(bench.folder / "session.json", "session")
    documents.write(bench.folder / "session.json", {**document, "episodes": document["episodes"][:1]}, "session")
    session = Bench(bench.folder).run(resume=True)
    assert len(session.episodes) == 2
    assert [p.name for p in session.unfinished] == ["episode-000001.interrupted-0.mcap"]


def test_a_session_on_a_level_skin_is_taken_up_again(tmp_path):
    bench = Bench(tmp_path / "session", presses=1)
    registration = {**bench.rig.document["registration"], "tilt": [-3.95e-05, 1e-07]}
    level = replace(bench.rig, document={**bench.rig.document, "registration": registration})
    bench.run(rig=level)
    assert read_session(bench.folder).document["rig"]["registration"]["tilt"] == [-3.95e-05, 1e-07]
    assert bench.run(rig=level, resume=True).remaining == ()


def test_another_plan_or_registration_cannot_continue_a_session(bench):
    bench.run()
    with pytest.raises(UsageError, match="another plan"):
        bench.run(resume=True, plan=plan(3, hold=0.3, rest=0.4))
    moved = {**bench.rig.document, "registration": {"origin": [10.0, 20.0, -31.0], "yaw": 5.0}}
    with pytest.raises(UsageError, match="another registration"):
        bench.run(resume=True, rig=replace(bench.rig, document=moved))


def test_a_controller_that_no_longer_obeys_is_said_and_the_file_closed(bench):
    def fault():
        bench.cnc.refuses = True
        bench.board.broken = DeviceError("the line to the taxel board broke", "a port", "check the cable")

    bench.cnc.fault_at, bench.cnc.on_fault = 3, fault
    with pytest.raises(DeviceError, match="taxel board broke"):
        bench.run()
    (broken,) = file_names.unfinished(bench.folder)
    assert any("not lifted" in note for note in read_recording(broken).episode.notes)


def test_a_full_disk_stops_the_motion_and_says_so(bench, monkeypatch):
    from tacdata.recording.files.chunked_file import ChunkedFile

    add, count = ChunkedFile.add, iter(range(10**9))

    def full(self, *message):
        if next(count) > 100:
            raise OSError(28, "No space left on device")
        add(self, *message)

    monkeypatch.setattr(ChunkedFile, "add", full)
    with pytest.raises(DeviceError, match="No space left"):
        bench.run()
    assert "feed_hold" in bench.cnc.calls
    (partial,) = bench.folder.glob("*.partial.mcap")
    assert len(read_recording(partial).episode.taxels.counter) >= 0


def test_streams_end_with_the_session(bench):
    before = threading.active_count()
    bench.run()
    assert threading.active_count() <= before


def test_a_board_of_another_skin_is_refused_before_anything_is_opened(bench):
    bench.board.describe = lambda: {"channels": 16, "rate": {"nominal": 30.0, "unit": "Hz"}}
    with pytest.raises(UsageError, match=r"the board sends 16 channels, and the sensor .* has 24 taxels") as caught:
        bench.run()
    assert "--sensor" in caught.value.remedy
    assert not bench.cnc.calls and not bench.folder.exists()
