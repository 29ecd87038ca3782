"""The demo goes through the verbs, leaves everything it names, and stops gently."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tacdata import extras, schemas
from tacdata.commands import demo
from tacdata.errors import PackageError, UsageError

DEMO = [sys.executable, "-m", "tacdata.cli", "demo"]


def test_an_existing_folder_is_left_alone(tmp_path, capsys):
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "mine.txt").write_text("mine")
    (tmp_path / "demo-2").mkdir()
    assert demo._new_folder(tmp_path / "demo") == tmp_path / "demo-3"
    assert "left as it is" in capsys.readouterr().out
    assert [p.name for p in (tmp_path / "demo").iterdir()] == ["mine.txt"]
    assert demo._new_folder(tmp_path / "new") == tmp_path / "new"


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="file"):
        demo._new_folder(tmp_path / "file" / "demo")


@pytest.mark.long("tacdata/commands", reason="a rig started, registered and interrupted, in its own time")
@pytest.mark.timeout(1200)
def test_an_interrupt_while_recording_leaves_readable_files(tmp_path):
    from tacdata.labels import read_label
    from tacdata.recording.files.reader import read_episode
    from tacdata.recording.session import read_session

    log = tmp_path / "log"
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [*DEMO, "--out", str(tmp_path / "out"), "--presses", "8", "--speed", "8"], stdout=stream, stderr=stream
        )
    try:
        deadline = time.monotonic() + 240
        while "press 1 of 8" not in log.read_text() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.4)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130, log.read_text()
    finally:
        process.kill()
    shown = log.read_text()
    assert "stopped at stage 3" in shown
    assert "NOT REGISTERED" not in shown and "no registration was measured" not in shown
    assert "Traceback" not in shown
    session = read_session(tmp_path / "out" / "session")
    assert 1 <= len(session.episodes) < 8
    for path in (*session.episodes, *session.unfinished):
        assert len(read_episode(path).taxels.counter) > 0
    # Labels are begun beside the recording: those that are there are whole, and nothing is left of others.
    labels = tmp_path / "out" / "session" / "labels"
    assert all(len(read_label(path).time_ns) for path in labels.glob("episode-*.parquet"))
    assert not list(labels.glob("*.partial"))
    # The rig went with it: its ports are closed and its rig file is gone.
    assert "stopped" in (tmp_path / "out" / "virtual-rig.log").read_text()
    assert not (tmp_path / "out" / "rig" / "rig.yaml").exists()


@pytest.mark.long("tacdata/commands", reason="the whole job, eight presses solved on the default skin")
@pytest.mark.timeout(2400)
def test_the_whole_job(tmp_path):
    done = subprocess.run(
        [*DEMO, "--out", str(tmp_path / "out"), "--presses", "8", "--epochs", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    left_behind(tmp_path / "out", done.stdout)
    accuracy = re.search(
        r"right to (\S+) mm in peak depth, (\S+) mm over the contact and (\S+) mm in place", done.stdout
    )
    scores = json.loads((tmp_path / "out" / "network" / "scores" / "scores.json").read_text())
    assert float(accuracy[1]) == pytest.approx(scores["contact_frames"]["peak_error"]["median"], abs=0.005)
    assert "next: open" in done.stdout

    # Stopped before its scores, it goes on there and records nothing again.
    shutil.rmtree(tmp_path / "out" / "network" / "scores")
    (tmp_path / "out" / "episode.png").unlink()
    again = subprocess.run(
        [*DEMO, "--out", str(tmp_path / "out"), "--presses", "8", "--epochs", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert again.returncode == 0, again.stdout
    assert re.findall(r"^\$ tacdata ([a-z-]+)", again.stdout, re.M) == ["label", "train", "evaluate", "view"]
    assert (tmp_path / "out" / "episode.png").exists()


def test_a_missing_extra_is_named_before_the_first_move(tmp_path, monkeypatch):
    monkeypatch.setattr(
        extras, "packages_of", lambda extra: {"fem": ("warp-lang", "numpy"), "learn": ()}.get(extra, ())
    )
    monkeypatch.setattr(extras, "_installed", lambda package: package != "warp-lang")
    with pytest.raises(PackageError, match="warp-lang, which is not installed") as caught:
        demo.run(tmp_path / "demo")
    assert "fem,learn,view" in caught.value.remedy
    assert not (tmp_path / "demo").exists()


def test_the_packages_of_an_extra_leave_out_those_of_the_plain_install():
    packages = extras.packages_of("fem")
    assert {"warp-lang", "torch", "pytetwild"} <= set(packages) and "numpy" not in packages


def left_behind(out, said):
    """Assert that every verb ran and all is there that the demo names."""
    typed = re.findall(r"^\$ tacdata ([a-z-]+)", said, re.M)
    assert typed == ["virtual-rig", "register", "plan", "label", "record", "check", "pack", "train", "evaluate", "view"]
    assert "MISSING" not in said
    assert len(list((out / "session").glob("episode-*.mcap"))) == 8
    assert len(list((out / "session" / "labels").glob("episode-*.parquet"))) == 8
    scores = json.loads((out / "network" / "scores" / "scores.json").read_text())
    assert scores["version"] == schemas.version("scores")
    for picture in (out / "episode.png", out / "network" / "scores" / "scores.png"):
        assert picture.read_bytes()[:4] == b"\x89PNG"
    assert (out / "episode.rrd").stat().st_size > 10_000
