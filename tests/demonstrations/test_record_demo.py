"""A demonstration through the verbs, from a virtual hand to paths; and what is refused on the way."""

import shutil
import sys

import numpy as np
import pytest
import yaml
from demo_examples import rig

from tacdata.cli import main
from tacdata.demonstrations.paths.tracks_file import path_of, read_tracks
from tacdata.demonstrations.recording.images import stored_images
from tacdata.demonstrations.recording.reader import read_demo
from tacdata.demonstrations.recording.recorder import DemoRecorder
from tacdata.demonstrations.recording.rig import read_demo_rig
from tacdata.demonstrations.recording.session import open_demo_session, read_demo_session
from tacdata.errors import FormatError, UsageError
from tacdata.recording.check.report import check
from tacdata.sensor import Sensor, default_sensor
from tacdata.tags import look
from tacdata.virtual_rig.demo import FINGERS, VirtualDemo
from tacdata.wire import default_format

CHANNELS = {"thumb": 24, "index": 12, "middle": 24}
"""Finger -> channels of its board."""


class Now:
    """A detector that answers in the caller's thread."""

    def __call__(self, *arguments):
        from concurrent.futures import Future

        answer = Future()
        answer.set_result(look(*arguments))
        return answer


def kept_up(path):
    """Return whether no second is without an image: an emulated camera that starves falls behind its boards."""
    times, _ = stored_images(path)
    ends = read_demo(path).taxels["thumb"].sample_ns[[0, -1]]
    return np.diff([ends[0], *times, ends[1]]).max() < 1e9


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Five seconds of a hand with one camera, slower than real time; its index finger wears another skin.

    Recorded again, and slower, where the images fell behind: all tests here share it, and a machine that has other
    things to do may paint fewer of them a second than the rig's clock asks for.
    """
    for speed in (0.6, 0.3, 0.1):
        made = recording(tmp_path_factory.mktemp("demo"), speed)
        if kept_up(made[0]):
            return made
    pytest.fail("the images fell behind even at a tenth of real time")


def recording(folder, speed):
    paper = default_sensor().document
    other = Sensor.from_document({**paper, "taxels": {**paper["taxels"], "columns": 4, "rows": 3}}, "index")
    demo = VirtualDemo(folder / "rig", speed=speed, seed=3, cameras=1, sensor={"index": other})
    demo.start()
    try:
        bench = read_demo_rig(demo.path)
        session = open_demo_session(folder / "demos", bench, "grasp", resume=False)
        with DemoRecorder(session, bench, Now()) as recorder:
            path = recorder.record(lambda: False, seconds=5.0)
    finally:
        demo.stop()
    return path, demo


def test_three_boards_and_a_camera_come_into_one_file(recorded):
    path, _ = recorded
    found = read_demo(path)
    assert found.complete and found.task == "grasp" and found.rig.frame == "table"
    assert set(found.taxels) == {"thumb", "index", "middle"} == {view.finger for view in found.views}
    for finger, stream in found.taxels.items():
        assert (stream.sample_ns[-1] - stream.sample_ns[0]) * 1e-9 > 4.5, "a busy machine stops late, never early"
        assert (np.diff(stream.counter) == 1).all() and stream.counts.shape[1] == CHANNELS[finger]
        assert np.median(np.diff(stream.sample_ns)) == pytest.approx(1e9 / 30, rel=1e-3)
    for view in found.views:
        seen = view.faces > 0
        assert seen.mean() > 0.8
    assert read_demo_session(path.parent).document["episodes"][0]["file"] == path.name


def test_the_verbs_track_and_export_it(recorded, tmp_path, capsys):
    path, demo = recorded
    shutil.copytree(path.parent, tmp_path / "demos")
    assert run(["track", str(tmp_path / "demos"), "--every-image"]) == 0  # also those that a busy machine passed over
    made = read_tracks(path_of(tmp_path / "demos" / path.name))
    assert set(made.tracks) == set(FINGERS["fingers"])
    for name, track in made.tracks.items():
        times = (made.time_ns - demo.start_ns) * 1e-9
        truth = np.array([demo.hand.tip(name, t)[:3, 3] for t in times])
        near = ~track.gap
        assert near.mean() > 0.6
        # The emulated camera shares this machine's cores: its images may come late and so be timed late.
        assert 1000 * np.median(np.linalg.norm(track.position - truth, axis=1)[near]) < 3.0
    # A busy machine may leave holes between images, which export refuses to fill with guesses unless it is told to.
    export = ["export", str(tmp_path / "demos"), "--with-guesses", "--out"]
    assert run([*export, str(tmp_path / "out"), "--format", "csv", "--direct"]) == 0
    assert (tmp_path / "out" / "episode-000000.csv").is_file()
    assert run([*export, str(tmp_path / "more")]) == 2
    assert "tacdata track with --network" in capsys.readouterr().err
    assert not (tmp_path / "more").exists()


def test_what_a_crash_left_is_read(recorded, tmp_path):
    path, _ = recorded
    cut = tmp_path / "episode-000000.mcap"
    data = path.read_bytes()
    cut.write_bytes(data[: int(0.8 * len(data))])
    found = read_demo(cut)
    assert not found.complete and any("breaks off" in note for note in found.notes)
    assert min(len(stream.counts) for stream in found.taxels.values()) > 30


def test_a_demonstration_is_no_press(recorded):
    with pytest.raises(UsageError, match="no session"):
        check(recorded[0].parent)


def run(arguments):
    """Run a verb as typed; return its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["tacdata", *arguments])
        try:
            main()
        except SystemExit as end:
            return end.code or 0
    return 0


def documents_of(tmp_path, **changes):
    document = {**rig().document, **changes}
    for entry in document["cameras"].values():
        entry.pop("source", None)
        entry["source"] = str(tmp_path / "none.mp4")
    path = tmp_path / "demo_rig.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def test_a_demo_rig_is_checked(tmp_path):
    boards = rig().document["boards"]
    for changes, words in (
        ({"boards": {"pinky": boards["thumb"]}}, "pinky, which carry no cube"),
        ({"boards": {}, "sensors": {"thumb": rig().document["sensors"]["thumb"]}}, "a sensor but no board for thumb"),
        ({"latencies": {"ear": {"latency_ns": 1, "uncertainty_ns": 1, "source": "x"}}}, "a latency of ear"),
        ({"cameras": {}}, "cameras"),
        ({"boards": {f"finger{k}": boards["thumb"] for k in range(4)}}, "boards"),
    ):
        with pytest.raises(FormatError, match=words):
            read_demo_rig(documents_of(tmp_path, **changes))
    with pytest.raises(UsageError, match="no file"):
        read_demo_rig(documents_of(tmp_path, fingers="none.yaml"))


def test_cameras_must_stand_in_one_world(tmp_path):
    two = rig(cameras=("a", "b")).document["cameras"]
    lost = {"a": two["a"], "b": {k: v for k, v in two["b"].items() if k != "world"}}
    with pytest.raises(FormatError, match="no pose is given for camera b"):
        read_demo_rig(documents_of(tmp_path, cameras=lost))
    other = {"a": two["a"], "b": {**two["b"], "world": {**two["b"]["world"], "frame": "robot"}}}
    with pytest.raises(FormatError, match="several worlds"):
        read_demo_rig(documents_of(tmp_path, cameras=other))
    alone = {"a": {k: v for k, v in two["a"].items() if k != "world"}}
    found = read_demo_rig(documents_of(tmp_path, cameras=alone))
    assert found.frame == "camera a" and np.array_equal(found.camera_pose("a"), np.eye(4))


def test_a_missing_board_is_named_by_its_finger_and_leaves_nothing_behind(tmp_path, capsys):
    path = documents_of(tmp_path)
    out = tmp_path / "demos"
    assert run(["record", "--demo", "--rig", str(path), "--out", str(out), "--seconds", "1"]) == 4
    words = capsys.readouterr().err
    assert "error: board of " in words
    assert words.endswith("  data:   nothing was written\n  then:   the same command\n")
    assert not out.exists()


def test_the_last_words_of_an_interrupted_demonstration_say_what_is_on_disk(recorded, tmp_path, monkeypatch, capsys):
    path, out = documents_of(tmp_path), tmp_path / "demos"

    def broken_off(self):
        (out / "episode-000000.mcap").write_bytes(recorded[0].read_bytes())
        (out / "episode-000001.partial.mcap").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(DemoRecorder, "__enter__", broken_off)
    assert run(["record", "--demo", "--rig", str(path), "--out", str(out), "--seconds", "1"]) == 130
    words = capsys.readouterr().err
    assert "interrupted\n  data:   1 demonstrations are complete in " in words
    assert "data:   broken off, readable: episode-000001.partial.mcap\n" in words
    assert words.endswith("then:   the same command with --resume\n")


def test_arguments_that_do_not_fit_are_refused(tmp_path, capsys):
    path = documents_of(tmp_path)
    common = ["--rig", str(path), "--out", str(tmp_path / "demos")]
    assert run(["record", "--demo", *common, "--seconds", "-1"]) == 2
    assert run(["record", "--demo", *common, "--plan", "plan.yaml"]) == 2
    assert "--demo with --plan" in capsys.readouterr().err
    assert run(["record", *common]) == 2
    assert "no --plan" in capsys.readouterr().err
    (tmp_path / "demos").mkdir()
    assert run(["record", "--demo", *common, "--seconds", "1"]) == 2
    assert run(["record", "--demo", *common, "--seconds", "1", "--resume"]) == 2
    assert run(["track", str(tmp_path / "demos")]) == 2
    assert run(["track", str(tmp_path / "none")]) == 2
    assert "a folder that record --demo wrote" in capsys.readouterr().err


def test_a_virtual_demonstration_is_refused_what_it_cannot_do(tmp_path, capsys):
    assert run(["virtual-rig", str(tmp_path / "rig"), "--nub", "8"]) == 2
    assert "--nub 8 without --demo" in capsys.readouterr().err
    with pytest.raises(UsageError, match="fault 'fire'"):
        VirtualDemo(tmp_path, fault="fire")
    with pytest.raises(UsageError, match="nubs of 0 mm"):
        VirtualDemo(tmp_path, nub=0.0)
    with pytest.raises(UsageError, match="3 cameras"):
        VirtualDemo(tmp_path, cameras=3)


def test_a_board_that_is_not_the_fingers_is_refused_by_name(tmp_path):
    formats = default_format().document
    bench = rig()
    bench.boards["index"]["format"] = {**formats, "channels": {**formats["channels"], "count": 16}}
    session = open_demo_session(tmp_path / "demos", bench, "grasp", resume=False)
    with pytest.raises(UsageError, match="the board of index sends 16 channels") as caught:
        DemoRecorder(session, bench, Now()).__enter__()
    assert "sensors in the demo rig" in caught.value.remedy
