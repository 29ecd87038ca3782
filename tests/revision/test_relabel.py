"""Labels made again under a revised model: only what changes is solved, and it is said how far labels move."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "label_farm"))
from farm_examples import HERE, SENSOR, label_episodes, press_episode

from tacdata.effects import Placed, load
from tacdata.label_farm.labelling import FarmSettings
from tacdata.revision.labels import relabel
from tacdata.revision.labels.relabel import changed_skin, moves_labels, relabelled

SETTINGS = FarmSettings(factory="fast_model:FastModel", workers=1)


@pytest.fixture
def session(tmp_path, monkeypatch):
    """Two presses with their labels, by the farm's fast model: a surface is the depth times a bump."""
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    episodes = {n: press_episode(tmp_path, n, x=1.0 * n, depth=1.0) for n in (0, 1)}
    label_episodes(tmp_path / "labels", episodes.values(), workers=1)
    paths = [e.path for e in episodes.values()]
    monkeypatch.setattr(relabel, "read_session", lambda folder: SimpleNamespace(episodes=paths, sensor=SENSOR))
    monkeypatch.setattr(relabel, "read_episode", lambda path: episodes[int(path.stem[-6:])])
    return tmp_path


def placed(name, **values):
    return [Placed(load(name), {k: np.array(v) for k, v in values.items()})]


def test_play_moves_labels_without_a_single_new_solve(session):
    old = (session / "labels" / "episode-000000.parquet").read_bytes()
    moved = relabelled(session, placed("backlash", b=0.1), session / "new", SETTINGS)
    assert (moved.labels, moved.solved, moved.found) == (2, 0, 2)
    assert moved.most == pytest.approx(0.1, abs=0.01) and 0.02 < moved.rms < 0.1
    assert moved.path_most == pytest.approx(0.1)
    assert (session / "labels" / "episode-000000.parquet").read_bytes() == old, "the old labels stay"


def test_a_shifted_depth_is_solved_anew_and_moves_labels_by_as_much(session):
    moved = relabelled(session, placed("z_offset", dz=0.05), session / "new", SETTINGS)
    assert moved.solved == 2 and moved.failed == {}
    assert moved.most == pytest.approx(0.05, abs=0.005)


def test_late_readings_belong_to_where_the_tip_was_before(session):
    moved = relabelled(session, placed("latency", L=0.1), session / "new", SETTINGS)
    assert moves_labels(placed("latency", L=0.1))
    assert (moved.labels, moved.solved, moved.found) == (2, 0, 2), "the same presses"
    assert moved.most == pytest.approx(0.15, abs=0.01), "1.5 mm/s for 0.1 s"


def test_effects_of_the_readings_leave_labels_alone(session):
    assert not moves_labels(placed("low_pass_filter", tau=0.05)) and moves_labels(placed("backlash", b=0.1))
    assert changed_skin(SENSOR, placed("latency", L=0.05)) is None
    thicker = changed_skin(SENSOR, placed("thickness", e=0.1))
    assert thicker is not None and thicker.skin.thickness == pytest.approx(1.1 * SENSOR.skin.thickness)
