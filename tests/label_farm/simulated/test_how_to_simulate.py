"""The commands of the page on simulated datasets run as they stand, with a stand-in for the skin model."""

import numpy as np
import pytest
from bump_skin import BumpSkin
from running.in_process import tacdata
from running.typed_pages import HOW_TO, blocks, commands
from test_press_effects import entry, verdict

from tacdata import documents
from tacdata.dataset import read_dataset
from tacdata.label_farm.simulated import solving
from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.label_farm.simulated.press_effects import drawn_effects
from tacdata.sensor import default_sensor

PAGE = HOW_TO / "simulate.md"


def test_the_page_is_typed_from_its_first_command_to_its_last(tmp_path, monkeypatch):
    monkeypatch.setattr(
        solving, "specimen_model", lambda simulation, number, device: BumpSkin(simulation.specimens[number], 99.0)
    )
    sensor = default_sensor().document
    sensor["name"] = "own"
    documents.write(tmp_path / "sensor.yaml", sensor, "sensor")
    plan, effects = blocks(PAGE, "yaml")
    documents.write(tmp_path / "verdict.json", verdict(entry()), "verdict")
    (tmp_path / "plan.yaml").write_text(plan + effects)
    typed = commands(PAGE)
    assert {words[0] for words in typed} == {"simulate"}
    for words in typed:
        done = tacdata(*words, "--device", "cpu", "--workers", 1, folder=tmp_path)
        assert done.returncode == 0, f"{words}: {done.stderr}"
    made = {
        name: read_dataset(tmp_path / name)
        for name in ("pretraining", "own_pretraining", "two_balls", "copied", "with_effects")
    }
    assert all(len(dataset.episodes) == dataset.simulated == 3 for dataset in made.values())
    assert {e.press.indenter.shape for e in made["two_balls"].episodes} <= {"sphere", "pair"}
    for key in ("observation.tactile_raw", "observation.depth"):
        assert np.array_equal(made["pretraining"][key], made["copied"][key])


def test_every_field_of_the_pages_plan_is_known():
    plan, effects = blocks(PAGE, "yaml")
    found = SimulationPlan.from_document(documents.parsed(plan + effects, "the page"), "the page")
    assert [one.effect.name for one in drawn_effects(found)] == ["relaxation", "latency"]
    assert [shape.weight for shape in found.shapes] == [pytest.approx(2.0), pytest.approx(1.0)]
