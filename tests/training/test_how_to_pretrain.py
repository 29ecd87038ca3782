"""The commands of the page on pretraining run as they stand, with a stand-in for the skin model and few presses."""

import sys
from pathlib import Path

import pytest
from running.in_process import tacdata
from running.typed_pages import HOW_TO, blocks, commands
from test_training_verbs import BALL, write_dataset
from training_frames import build_frames

sys.path.append(str(Path(__file__).resolve().parents[1] / "label_farm"))
sys.path.append(str(Path(__file__).resolve().parents[1] / "label_farm" / "simulated"))
from bump_skin import BumpSkin

from tacdata import documents
from tacdata.label_farm.simulated import solving
from tacdata.sensor import default_sensor
from tacdata.training.inference import checkpoint
from tacdata.training.pretraining import shipped

PAGE = HOW_TO / "pretrain.md"
QUICK = {
    "train": ("--epochs", 1, "--threads", 1, "--device", "cpu"),
    "learning-curve": ("--seeds", 1, "--threads", 1, "--device", "cpu"),
    "simulate": ("--workers", 1, "--device", "cpu"),
}
"""What makes a command short, by its verb."""
SHAPES = (
    BALL,
    {"shape": "flat_punch", "radius": 1.5, "edge_radius": 0.3},
    {"shape": "ring", "ring_radius": 2.0, "tube_radius": 0.5},
)


@pytest.fixture
def typed(tmp_path, monkeypatch):
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(
        solving, "specimen_model", lambda simulation, number, device: BumpSkin(simulation.specimens[number], 99.0)
    )
    write_dataset(tmp_path / "dataset", build_frames(16, length=12), indenters=SHAPES)
    documents.write(tmp_path / "sensor.yaml", default_sensor().document, "sensor")
    [recipe] = blocks(PAGE, "yaml")
    (tmp_path / "two_balls.yaml").write_text(recipe)
    said = {}
    for words in commands(PAGE):
        done = tacdata(*words, *QUICK.get(words[0], ()), folder=tmp_path)
        assert done.returncode == 0, f"{words}: {done.stderr}"
        said.setdefault(words[0], []).append(done.stdout)
    return said


@pytest.mark.long("tacdata/commands", "docs/how_to/pretrain.md", reason="a page typed from beginning to end")
def test_the_page_is_typed_from_its_first_command_to_its_last(typed, tmp_path):
    assert set(typed) == {"train", "evaluate", "learning-curve", "simulate", "plan"}
    fitted = checkpoint.load(tmp_path / "network")
    assert fitted.document["pretrained"] == checkpoint.load(shipped.PATH).content_hash
    own = checkpoint.load(tmp_path / "network_of_ours")
    assert own.document["pretrained"] == checkpoint.load(tmp_path / "pretrained").content_hash
    assert own.document["simulated"]
    curve = documents.read(tmp_path / "curve" / "curve.json", "learning_curve")
    assert {(point["start"], point["presses"]) for point in curve["points"]} == {
        ("pretrained", 0),
        ("pretrained", 3),
        ("pattern", 3),
        ("pretrained", 10),
        ("pattern", 10),
    }
    said, alone = typed["learning-curve"]
    assert said.count("pretrained") >= 3 and "IoU > 0.2 mm" in said
    rows = [line.split()[:2] for line in alone.splitlines()[-4:-2]]
    assert rows == [["history", "3"], ["history", "10"]] and "pretrained" not in alone
    assert "12 presses with balls" in typed["plan"][0]
    assert (tmp_path / "curve" / "curve.png").read_bytes()[:4] == b"\x89PNG"
