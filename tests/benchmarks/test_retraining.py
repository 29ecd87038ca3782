"""Retraining: packed presses are those that a dataset holds, and all shapes of the plan can be pressed."""

import importlib.util
import os
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tacdata.label_farm.simulated.packing import write_dataset
from tacdata.label_farm.simulated.plan import SimulationPlan, read_simulation_plan
from tacdata.label_farm.simulated.press_draw import draw_press
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.solving import solve_batch
from tacdata.sensor import default_sensor
from tacdata.training.frames.data import read_frames
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import pretrained

sys.path.append(str(Path(__file__).resolve().parents[1] / "label_farm"))
sys.path.append(str(Path(__file__).resolve().parents[1] / "label_farm" / "simulated"))
from bump_skin import SMALL, BumpSkin

ROOT = Path(__file__).resolve().parents[2]


def module(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "benchmarks" / "retraining" / f"{name}.py")
    found = importlib.util.module_from_spec(spec)
    sys.modules[name] = found
    spec.loader.exec_module(found)
    return found


presses, retrain = module("presses"), module("retrain")


@pytest.fixture
def solved(tmp_path):
    simulation = Simulation(tmp_path / "solved", SimulationPlan.from_document(SMALL, "small"), default_sensor(), seed=3)
    simulation.folder.mkdir()
    simulation.open()
    for specimen in (0, 1):
        skin = BumpSkin(simulation.specimens[specimen])
        solve_batch(simulation, skin, list(range(specimen, 6, 2)), "cpu").write(simulation.folder)
    return simulation


def test_packed_presses_are_those_that_a_dataset_holds(solved, tmp_path, monkeypatch):
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(presses, "CHUNK", 2)
    episodes, total = write_dataset(solved, 6, tmp_path / "dataset")
    assert presses.pack(solved.folder, tmp_path / "packed", 1) == episodes
    packed, dataset = presses.read(solved.folder, tmp_path / "packed"), read_frames(tmp_path / "dataset")
    assert len(packed.taxels) == total
    assert packed.simulated
    same = {span.number: span for span in packed.episodes}
    # The dataset has its episodes in the order of presses; the packed ones lie specimen after specimen.
    for number, span in zip(sorted(same), dataset.episodes, strict=True):
        mine = same[number]
        assert replace(span, number=number, start=mine.start, stop=mine.stop, purpose="") == mine
        for name in ("taxels", "tip", "phase", "time_ns", "valid", "taxel_force"):
            ours, theirs = (getattr(of, name)[one.start : one.stop] for of, one in ((packed, mine), (dataset, span)))
            np.testing.assert_array_equal(ours, theirs, err_msg=name)
        # A dataset keeps labels in metres, in single precision.
        ours, theirs = packed.depth[mine.start : mine.stop], dataset.depth[span.start : span.stop]
        np.testing.assert_allclose(ours, theirs, rtol=1e-6)


def test_packing_goes_on_where_it_was(solved, tmp_path, monkeypatch):
    monkeypatch.setattr(presses, "CHUNK", 2)
    packed = tmp_path / "packed"
    presses.pack(solved.folder, packed, 1)
    first, *others = sorted(packed.glob("*.npz"))
    before = [os.stat(path).st_ino for path in others]
    first.unlink()
    assert presses.pack(solved.folder, packed, 1) == 6
    assert [os.stat(path).st_ino for path in others] == before


def test_of_frames_that_are_alike_few_are_learned_from(solved, tmp_path):
    presses.pack(solved.folder, tmp_path / "packed", 1)
    frames = presses.read(solved.folder, tmp_path / "packed")
    thin = presses.thinned(frames)
    assert len(thin.taxels) == len(frames.taxels)  # the others stay in windows
    assert 0 < thin.valid.sum() < 0.7 * frames.valid.sum()
    held = []
    for span in frames.episodes:
        depth, kept = frames.tip[span.start : span.stop, 2], thin.valid[span.start : span.stop]
        touching = frames.depth[span.start : span.stop].max(axis=(1, 2)) > 0.1
        full = touching & (depth == depth.max())
        held.append((int(full.sum()), int((full & kept).sum())))
        moves = np.abs(np.diff(depth[touching & kept]))
        # A frame that is kept has moved on from the one before, or is one of a hold.
        assert (moves >= presses.MOVED - 1e-6).sum() + 3 >= len(moves), span
    assert any(all_of > 5 for all_of, _ in held)
    assert all(some <= 4 for _, some in held)


def test_the_recipe_is_that_of_the_network_that_ships():
    settings = recipe({**retrain.RECIPE, **retrain.VARIED, "batch_size": 2048, "epochs": 1}, None)
    assert settings.document == pretrained("shipped").document["settings"]


def test_the_plan_presses_each_of_its_shapes():
    plan, sensor = read_simulation_plan(retrain.PLAN), default_sensor()
    drawn = Counter(draw_press(plan, sensor, 0, number).indenter_name for number in range(600))
    assert set(drawn) == {shape.name for shape in plan.shapes}
    weights = sum(shape.weight for shape in plan.shapes)
    for shape in plan.shapes:
        # Sizes that find no place are drawn again, so wide shapes come up less often than their weight says.
        assert drawn[shape.name] > 0.3 * 600 * shape.weight / weights, shape.name
