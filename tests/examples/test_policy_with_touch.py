"""The policies with touch and without: dataset, training by lerobot and trials, at a small size."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "policy_with_touch"
pytestmark = pytest.mark.long(
    "examples/policy_with_touch",
    "tacdata/grasping",
    "tacdata/dataset/format",
    reason="two policies of lerobot are trained",
)


SCRIPTED = ["raw taxels, scripted", "camera alone, scripted", "true place, scripted"]


@pytest.fixture
def scene(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    import scene

    return scene


def test_touch_finds_what_the_camera_does_not_see(scene):
    world = scene.World(camera=3.0)
    controllers = {
        "touch": lambda trial: scene.by_touch(trial, "raw_taxel"),
        "camera": lambda _: scene.by_camera,
        "place": scene.by_place,
    }
    held, offsets = {}, {}
    for name, controller in controllers.items():
        trials = [scene.Trial(world, (7, number)) for number in range(20)]
        held[name] = sum(scene.run(trial, controller(trial))[0] for trial in trials)
        offsets[name] = np.median([abs(trial.place - trial.arm) for trial in trials])
    assert offsets["place"] < 0.15 and offsets["touch"] < 0.6 and offsets["camera"] > 1.2
    assert held["camera"] < held["touch"] <= held["place"] and held["touch"] >= 16


def test_equal_seeds_meet_the_same_orange(scene):
    world = scene.World(camera=3.0)
    first, second = (scene.Trial(world, (7, 0)).observe() for _ in range(2))
    assert all(np.array_equal(first[key], second[key]) for key in first)
    assert not np.array_equal(first[scene.CAMERA], scene.Trial(world, (7, 1)).observe()[scene.CAMERA])


@pytest.mark.timeout(900)
def test_lerobot_trains_on_the_dataset_and_touch_helps(scene, tmp_path):
    command = [sys.executable, str(FOLDER / "policy.py"), str(tmp_path / "out")]
    done = subprocess.run(
        [*command, "--episodes", "60", "--steps", "250", "--trials", "20"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    rows = dict(re.findall(r"^\| ([^|]+) \| (\d+)/20 \|", done.stdout, re.M))
    assert set(rows) == {"ACT with touch", "ACT without touch", *SCRIPTED}
    trials = json.loads((tmp_path / "out" / "trials.json").read_text())["trials"]
    for name, outcomes in trials.items():
        assert sum(held for held, _, _ in outcomes) == int(rows[name])
    assert int(rows["true place, scripted"]) >= int(rows["raw taxels, scripted"]) >= 16
    assert int(rows["ACT with touch"]) >= max(14, int(rows["ACT without touch"]) + 4)
    # The policy's hands end nearer to the orange with touch than without.
    offsets = {name: np.median([abs(offset) for _, _, offset in outcomes]) for name, outcomes in trials.items()}
    assert offsets["ACT with touch"] < 0.7 * offsets["ACT without touch"]
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("local/orange", root=tmp_path / "out" / "dataset_with_touch")
    assert dataset.num_episodes == 60
    assert dataset.meta.names[scene.STATE][2:4] == ["far.taxel_00.counts", "far.taxel_01.counts"]
    assert dataset[0][scene.STATE].shape == (50,)
