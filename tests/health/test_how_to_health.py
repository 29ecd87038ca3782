"""The commands of the page on health run as they stand."""

import json
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from running.in_process import tacdata
from running.typed_pages import HOW_TO, commands
from unit_examples import label

from tacdata import documents
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

sys.path.append(str(Path(__file__).resolve().parents[1] / "training"))

PAGE = HOW_TO / "health.md"


@pytest.fixture
def bench(folder, tmp_path):
    """A folder with two labelled visits and a trained network."""
    from training_frames import build_frames

    for name in ("monday", "tuesday"):
        label(Path(shutil.copytree(folder / name, tmp_path / name)), lambda counts: counts)
    settings = TrainingSettings(arguments={"hidden": 16, "channels": 4}, epochs=1)
    train(build_frames(4), settings, tmp_path / "network", device="cpu", threads=1)
    return tmp_path


@pytest.mark.long("tacdata/commands", "docs/how_to/health.md", reason="a page typed from beginning to end")
def test_every_command_of_the_page_runs(bench):
    said = {}
    for words in commands(PAGE):
        done = tacdata(*words, folder=bench)
        assert done.returncode == 0, f"tacdata {shlex.join(words)}: {done.stdout}{done.stderr}"
        said[shlex.join(words)] = done.stdout
    assert "11 presses" in said["plan health --out health.yaml --picture health_plan.png"]
    assert "FIRST VISIT" in said["health monday"]
    assert "ALL WELL" in said["health monday tuesday --out health"]
    assert "error in contact" in said["health monday tuesday --model network --out scored"]
    for place in ("monday", "health", "scored"):
        found = documents.read(bench / place / "health.json", "health")
        page = (bench / place / "health.html").read_text()
        assert found["advice"][0]["do"].replace("nothing", "all well") in page and "hysteresis loop" in page
    assert len(found["visits"][1]["comparisons"][0]["changes"]) > 90
    assert any(change["quantity"] == "network error" for change in found["visits"][1]["comparisons"][0]["changes"])


def test_json_and_exit_code_serve_a_script(folder, tmp_path):
    done = tacdata("health", folder / "tuesday", folder / "monday", "--json", "--out", tmp_path)
    assert done.returncode == 0
    assert [visit["session"] for visit in json.loads(done.stdout)["visits"]] == ["monday", "tuesday"]


def test_a_network_needs_labels(folder, tmp_path):
    from training_frames import build_frames

    settings = TrainingSettings(arguments={"hidden": 16, "channels": 4}, epochs=1)
    train(build_frames(4), settings, tmp_path / "network", device="cpu", threads=1)
    done = tacdata("health", folder / "monday", "--model", tmp_path / "network", "--out", tmp_path)
    assert done.returncode == 2 and "a network's error is against labels" in done.stderr
