"""A sensor that is a file alone goes from simulated presses to a network; a flat skin is told what its file lacks."""

from pathlib import Path

import pytest
from bump_skin import BumpSkin
from running.in_process import tacdata

from tacdata.dataset import read_dataset
from tacdata.label_farm.simulated import solving
from tacdata.sensor import read_sensor
from tacdata.training.inference import checkpoint

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"


def simulate(folder, sensor, *more):
    words = ("simulate", EXAMPLES / "eight_by_eight_presses.yaml", "--sensor", EXAMPLES / sensor, "--presses", 12)
    return tacdata(*words, "--out", "simulated", "--device", "cpu", "--workers", 1, *more, folder=folder)


@pytest.mark.long("label_farm", "training", reason="simulated presses become a dataset and a network")
def test_the_example_of_eight_by_eight_taxels_becomes_a_pretrained_network(tmp_path, monkeypatch):
    monkeypatch.setattr(
        solving, "specimen_model", lambda simulation, number, device: BumpSkin(simulation.specimens[number], 99.0)
    )
    made = simulate(tmp_path, "eight_by_eight.yaml")
    assert made.returncode == 0, made.stderr
    dataset = read_dataset(tmp_path / "simulated")
    assert dataset.simulated == len(dataset.episodes) == 12
    assert {e.press.indenter.shape for e in dataset.episodes} == {"sphere", "cylinder", "flat_punch"}
    words = ("train", "simulated", "--network", "pattern", "--epochs", 2, "--threads", 1, "--device", "cpu")
    trained = tacdata(*words, "--out", "network", folder=tmp_path)
    assert trained.returncode == 0, trained.stderr
    network = checkpoint.load(tmp_path / "network").network
    assert (network.taxels, network.map_shape) == (64, (40, 40))
    scored = tacdata("evaluate", "network", folder=tmp_path)
    assert scored.returncode == 0, scored.stderr


def test_a_flat_skin_is_told_all_that_its_file_lacks(tmp_path):
    refused = simulate(tmp_path, "own_sensor.yaml")
    assert refused.returncode == 3
    for word in ("flat_pad: a flat skin", "protrusion_radius", "contact/board", "transduction", "eight_by_eight.yaml"):
        assert word in refused.stderr
    assert not list(tmp_path.iterdir())


def test_the_example_has_what_its_file_says():
    sensor = read_sensor(EXAMPLES / "eight_by_eight.yaml")
    assert sensor.taxels.count == 64
    assert sensor.contact.board
    assert sensor.transduction.principle == "soft_dielectric"
