"""Labelling a session while it is recorded: the same workers take presses as they come, and end with the plan."""

import os
import threading
import time

import pytest
import session_examples
from farm_examples import HERE
from running.in_process import tacdata

from tacdata.label_farm import growing_session
from tacdata.label_farm.growing_session import GrowingSession
from tacdata.recording.session import read_session

FAST = ("--factory", "fast_model:FastModel", "--workers", "2", "--no-uncertainty")


@pytest.fixture
def half_recorded(tmp_path):
    """A session of six presses, the last four put aside."""
    folder, aside = session_examples.session(tmp_path / "session", 6), tmp_path / "aside"
    aside.mkdir()
    for path in read_session(folder).episodes[2:]:
        path.rename(aside / path.name)
    return folder, aside


def test_new_recordings_are_told_once_and_the_plan_ends_it(half_recorded, monkeypatch):
    monkeypatch.setattr(growing_session, "LOOK_SECONDS", 0.0)
    folder, aside = half_recorded
    coming = GrowingSession(folder)
    assert list(coming.new()) == [0, 1] and coming.new() == {} and not coming.ended
    assert coming.remaining == 4
    for path in sorted(aside.iterdir()):
        path.rename(folder / path.name)
    assert list(coming.new()) == [2, 3, 4, 5] and coming.ended and coming.remaining == 0


def test_a_session_that_stops_growing_is_not_waited_for_forever(half_recorded, tmp_path, monkeypatch):
    monkeypatch.setattr(growing_session, "LOOK_SECONDS", 0.0)
    stopped, missing = GrowingSession(half_recorded[0], silence=0.05), GrowingSession(tmp_path / "no", silence=0.05)
    stopped.new()
    time.sleep(0.1)
    assert stopped.new() == {} and stopped.ended and stopped.remaining == 4
    assert missing.new() == {} and missing.ended


def test_presses_are_labelled_as_they_come_by_one_run(half_recorded, quick_farm):
    folder, aside = half_recorded
    labels = folder / "labels"

    def record():
        deadline = time.monotonic() + 60
        while len(list(labels.glob("episode-*.parquet"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        for path in sorted(aside.iterdir()):
            path.rename(folder / path.name)
            time.sleep(0.3)

    recorder = threading.Thread(target=record)
    recorder.start()
    done = tacdata("label", folder, "--follow", *FAST)
    recorder.join()
    assert done.returncode == 0, done.stderr
    assert len(list(labels.glob("episode-*.parquet"))) == 6
    assert "labels written: 6" in done.stdout and "presses solved: 6" in done.stdout
    again = tacdata("label", folder, "--follow", *FAST)
    assert "labels written: 0" in again.stdout and "already there: 6" in again.stdout


def test_a_recorder_that_stopped_leaves_its_labels_and_is_named(half_recorded, quick_farm, monkeypatch):
    monkeypatch.setattr(growing_session, "SILENCE_SECONDS", 1.0)
    done = tacdata("label", half_recorded[0], "--follow", *FAST)
    assert "4 presses of the plan were not recorded" in done.stdout + done.stderr
    assert "labels written: 2" in done.stdout


@pytest.fixture
def quick_farm(monkeypatch):
    """Workers find the stand-in model."""
    monkeypatch.syspath_prepend(HERE)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), str(HERE.parent.parent)]))
