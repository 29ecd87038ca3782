"""The verb as it is typed."""

import json
import sys
from functools import partial

import pytest
from recorded_press import write_recording
from running.in_process import tacdata

from tacdata.labels import write_label


@pytest.fixture(scope="module")
def session(episode, label, images, tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    write_recording(folder / "episode-000003.mcap", episode, images)
    write_label(folder / "labels" / "episode-000003.parquet", label)
    return folder


@pytest.fixture
def view(monkeypatch):
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    return partial(tacdata, "view")


def test_file_and_picture_are_written_without_a_display(view, session, tmp_path):
    done = view(session, "--save", tmp_path / "new" / "e.rrd", "--picture", tmp_path / "new" / "e.png", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["written"] == [str(tmp_path / "new" / name) for name in ("e.rrd", "e.png")]
    assert "episode-000003" in told["shown"]
    assert (tmp_path / "new" / "e.rrd").read_bytes()[:3] == b"RRF"
    assert (tmp_path / "new" / "e.png").read_bytes()[:4] == b"\x89PNG"
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["e.png", "e.rrd"]


@pytest.mark.skipif(sys.platform != "linux", reason="only there a display can be missing")
def test_without_display_and_file_it_says_what_can_be_done(view, session):
    done = view(session)
    assert done.returncode == 2
    assert "no display" in done.stderr and "--save" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_existing_file_is_kept(view, session, tmp_path):
    (tmp_path / "e.rrd").write_text("mine")
    done = view(session, "--save", tmp_path / "e.rrd")
    assert done.returncode == 2 and "exists" in done.stderr
    assert (tmp_path / "e.rrd").read_text() == "mine"


def test_a_saved_file_cannot_be_saved_again(view, tmp_path):
    (tmp_path / "e.rrd").write_text("mine")
    done = view(tmp_path / "e.rrd", "--save", tmp_path / "f.rrd")
    assert done.returncode == 2 and "leave them out" in done.stderr
    assert not (tmp_path / "f.rrd").exists()


def test_a_wrong_path_ends_in_words(view, tmp_path):
    done = view(tmp_path / "nowhere", "--save", tmp_path / "e.rrd")
    assert done.returncode == 2
    assert "no file or folder" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "e.rrd").exists()


def test_a_folder_shows_the_only_thing_in_it(view, session, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "session").symlink_to(session, target_is_directory=True)
    done = view(folder, "--picture", tmp_path / "e.png")
    assert done.returncode == 0, done.stderr
    assert f"{folder} holds a session folder: {folder / 'session'}" in done.stdout
    assert (tmp_path / "e.png").is_file()


def test_a_folder_with_several_things_names_them(view, session, tmp_path):
    for name in ("monday", "tuesday"):
        (tmp_path / name).symlink_to(session, target_is_directory=True)
    done = view(tmp_path)
    assert done.returncode == 2
    assert f"{tmp_path} holds 2 things to view" in done.stderr
    assert f"{tmp_path / 'tuesday'} (a session folder)" in done.stderr
    assert f"next:    tacdata view {tmp_path / 'monday'}" in done.stderr


def test_an_empty_folder_is_refused(view, tmp_path):
    done = view(tmp_path, "--picture", tmp_path / "e.png")
    assert done.returncode == 2 and "no finished recording" in done.stderr
