"""`tacdata label`: what it prints, what it refuses, and its exit codes."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from tacdata import cli
from tacdata.errors import FormatError, SolveError

FARM = Path(__file__).resolve().parent.parent / "label_farm"


@pytest.fixture
def label(tmp_path, monkeypatch):
    """Run the verb on three presses of a session whose recordings are made up."""
    monkeypatch.syspath_prepend(FARM)
    from farm_examples import press_episode

    monkeypatch.setenv("PYTHONPATH", str(FARM))
    episodes = {f"episode-{k:06d}.mcap": press_episode(tmp_path, k, x=float(k), depth=k - 0.5) for k in range(3)}
    session = SimpleNamespace(episodes=tuple(tmp_path / name for name in episodes))
    pipeline = importlib.import_module("tacdata.pipeline.label")
    monkeypatch.setattr(pipeline, "read_session", lambda folder: session)
    monkeypatch.setattr(pipeline, "read_episode", lambda path: episodes[path.name])

    def run(*options):
        arguments = ["label", str(tmp_path), "--factory", "fast_model:FastModel", "--workers", "1", *options]
        return CliRunner().invoke(cli.application(), arguments)

    return run


def test_it_labels_a_session_and_says_what_it_did(tmp_path, label):
    shown = label()
    assert shown.exit_code == 0, shown.output
    assert "labels written: 3 (1 without contact), already there: 0, failed: 0" in shown.output
    assert "presses solved: 2" in shown.output and "next: tacdata pack" in shown.output
    assert len(list((tmp_path / "labels").glob("episode-*.parquet"))) == 3
    assert "labels written: 0 (0 without contact), already there: 3" in label().output


def test_what_it_did_comes_as_json_and_quietly(label):
    shown = label("--json", "--quiet")
    found = json.loads(shown.stdout)
    assert (len(found["written"]), found["untouched"], found["failed"]) == (3, 1, {})
    assert "labels written: 3" in shown.stderr
    assert "press 1 of 2" not in shown.stderr and "next:" not in shown.stderr


def test_it_says_how_well_the_labels_are_known(label):
    shown = label().output
    assert "by the sensor file's spreads: ± " in shown and "a state that is left out: 0.0000 mm" in shown
    shown = label("--no-uncertainty", "--redo", "--tolerance", "0.01").output
    assert "not known, none stated or asked for" in shown


def test_a_store_elsewhere_serves_as_well(tmp_path, label):
    assert label("--store", str(tmp_path / "shared")).exit_code == 0
    assert len(list((tmp_path / "shared").rglob("*.npz"))) == 2 and not (tmp_path / "labels" / "store").exists()


def test_a_failed_press_is_named_and_ends_with_an_error(tmp_path, label, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_FAILS", "2")
    shown = label()
    assert isinstance(shown.exception, SolveError) and "1 of 3 episodes" in shown.exception.given
    assert "episode 2: no label: no equilibrium at state 3" in shown.output
    assert "labels written: 2" in shown.output


def test_bad_input_ends_in_words(tmp_path):
    finished = subprocess.run(
        [sys.executable, "-m", "tacdata.cli", "label", "nowhere"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(FARM.parent.parent)},
    )
    assert finished.returncode == 2
    assert "nowhere is no session" in finished.stderr and "next:" in finished.stderr
    assert "Traceback" not in finished.stderr


def test_what_the_model_says_of_itself_reaches_the_user(label, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_REMARK", "material law yeoh is unstable above 1.5")
    shown = label()
    assert shown.exit_code == 0
    assert "warning: material law yeoh is unstable above 1.5" in shown.stderr


def test_failures_of_one_reason_end_with_its_remedy(label, monkeypatch):
    request = importlib.import_module("tacdata.label_farm.labels.request")

    def refuse(episode, sensor):
        raise FormatError(f"{episode.path}: imported without indenter", "a known one", "name the indenter")

    monkeypatch.setattr(request, "_check_known", refuse)
    error = label().exception
    assert "3 of 3 episodes have no label" in error.given and error.remedy == "name the indenter"
