"""A recording that is being written: every row is drawn once, however the file grows, and its end is seen."""

import contextlib
import itertools
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr
from recorded_press import write_recording
from rerun.chunk import RrdReader

from tacdata.errors import FormatError, UsageError
from tacdata.recording.files import chunked_file
from tacdata.recording.files.growing_file import GrowingFile
from tacdata.recording.files.reader import read_recording, recording_of
from tacdata.viewers.live import fed_viewer, following
from tacdata.viewers.live.following import Follower, is_growing, meant


@pytest.fixture(scope="module")
def written(episode, images, tmp_path_factory):
    """The bytes of a recording in many small chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunked_file, "CHUNK_BYTES", 3000)
        path = write_recording(tmp_path_factory.mktemp("written") / "episode-000003.mcap", episode, images)
    return path


def grow(path, content, cuts):
    """Yield after each piece of ``content`` has reached the file; the cuts heed no record's bounds."""
    with path.open("wb") as stream:
        for a, b in zip((0, *cuts), (*cuts, len(content)), strict=True):
            stream.write(content[a:b])
            stream.flush()
            yield


def test_a_growing_file_says_what_the_finished_one_says(written, tmp_path):
    content, path = written.read_bytes(), tmp_path / "episode-000003.partial.mcap"
    grown, counts = None, []
    for _ in grow(path, content, np.linspace(len(content) // 10, len(content) - 1, 12).astype(int).tolist()):
        grown = grown or GrowingFile(path)
        grown.update()
        counts.append(len(grown.records.columns_of("/taxels").data))
    assert grown.finished
    assert not grown.update()
    assert counts == sorted(counts)
    assert len(set(counts)) >= 4
    ours, theirs = recording_of(grown.records).episode, read_recording(written).episode
    assert ours.complete
    assert np.array_equal(ours.taxels.counts, theirs.taxels.counts)
    assert np.array_equal(ours.tip, theirs.tip)
    grown.close()


def test_every_row_is_drawn_once_and_the_end_is_seen(written, tmp_path):
    content, path = written.read_bytes(), tmp_path / "episode-000003.partial.mcap"
    recording, follower, drawn = rr.RecordingStream("test"), None, []
    recording.save(tmp_path / "followed.rrd")
    for _ in grow(path, content, [len(content) * k // 9 for k in range(1, 9)]):
        follower = follower or Follower(path, recording)
        follower.step()
        drawn.append(follower.frames)
    path.rename(tmp_path / "episode-000003.mcap")  # as the recorder does at the end
    assert follower.finished
    assert not follower.step()
    follower.close()
    recording.disconnect()
    assert drawn == sorted(drawn)
    assert len(set(drawn)) >= 4
    assert drawn[-1] == 120
    rows, about = Counter(), []
    for chunk in RrdReader(tmp_path / "followed.rrd").stream():
        if not chunk.is_static:
            rows[str(chunk.entity_path)] += chunk.num_rows
        elif str(chunk.entity_path) == "/about":
            about += [str(row) for row in chunk.to_record_batch()["TextDocument:text"].to_pylist()]
    for path in ("/heat_map", "/world/taxels", "/curves/taxels/change", "/curves/clock/taxels", "/maps/marks/tip"):
        assert rows.get(path, 120) == 120, path
    assert rows["/heat_map"] == rows["/curves/taxels/change"] == 120
    assert rows["/cameras/top/image"] == 30
    assert "being recorded" in about[0]
    assert "being recorded" not in about[-1]


def test_what_is_no_recording_is_refused_in_words(tmp_path):
    with pytest.raises(UsageError, match="no file"):
        GrowingFile(tmp_path / "episode-000000.partial.mcap")
    (tmp_path / "episode-000000.partial.mcap").write_bytes(b"nothing of the kind")
    with pytest.raises(FormatError, match="no MCAP file"):
        GrowingFile(tmp_path / "episode-000000.partial.mcap")
    assert meant(tmp_path) == tmp_path / "episode-000000.partial.mcap"
    (tmp_path / "episode-000001.mcap").write_bytes(b"")
    assert meant(tmp_path / "episode-000001.partial.mcap") == tmp_path / "episode-000001.mcap"
    assert meant(tmp_path) == tmp_path
    assert is_growing(tmp_path / "episode-000000.partial.mcap")
    assert not is_growing(tmp_path / "episode-000000.mcap")


class Dying:
    """An object of Rerun's kind, whose finalizer swallows what is raised in it."""

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0)  # a handler runs between two instructions


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as a signal")
def test_a_ctrl_c_within_a_finalizer_ends_the_viewer(tmp_path, monkeypatch):
    turns = itertools.count()
    viewer = SimpleNamespace(process=SimpleNamespace(poll=lambda: None if next(turns) < 20 else 0), address="")
    monkeypatch.setattr(fed_viewer, "fed_viewer", lambda web: contextlib.nullcontext(viewer))
    monkeypatch.setattr(following, "_follow_one", lambda *arguments: Dying() and None)
    monkeypatch.setattr(following, "PAUSE", 0.0)
    handler = signal.getsignal(signal.SIGINT)
    following.follow(tmp_path / "episode-000003.partial.mcap", web=False)
    assert next(turns) <= 3
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as a signal")
def test_the_verb_follows_until_the_recording_ends_and_ctrl_c_ends_the_viewer(written, tmp_path):
    content, path = written.read_bytes(), tmp_path / "episode-000003.partial.mcap"
    path.write_bytes(content[: len(content) // 2])
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "tacdata.cli", "view", str(path), "--web"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as verb:
        said = [verb.stdout.readline(), verb.stdout.readline()]
        with path.open("ab") as stream:
            stream.write(content[len(content) // 2 :])
        said.append(verb.stdout.readline())
        (tmp_path / "episode-000004.partial.mcap").write_bytes(content)  # the next press of the session
        said.append(verb.stdout.readline())
        verb.send_signal(signal.SIGINT)
        rest = verb.stdout.read()
    assert said[0].startswith("open http://127.0.0.1:")
    assert said[1:] == [
        "following episode-000003.partial.mcap; Ctrl-C ends the viewer, never the recording\n",
        "episode-000003 has ended: 120 frames\n",
        "episode-000004 has ended: 120 frames\n",
    ]
    assert verb.returncode == 0
    assert "Traceback" not in rest
