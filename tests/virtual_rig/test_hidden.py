"""What is hidden in the virtual world: play, late readings, a soft frame; and the truth that is written of it."""

import csv

import numpy as np
import pytest

from tacdata.errors import UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.rig import Registration
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.hidden import TIP_PATH, HiddenWorld, hidden_from
from tacdata.virtual_rig.world.world import World, draw

NOMINAL = Registration((0.0, 0.0, 0.0), 0.0)
SENSOR = default_sensor()
TRUTH = draw(3, SENSOR, NOMINAL)
STEP = 33_000_000
DEPTH = np.concatenate([np.linspace(-0.2, 0.8, 30), np.full(20, 0.8), np.linspace(0.8, -0.2, 30)])


def pressed(world):
    """Press a ball at the centre down to 0.8 mm and up again; return all frames."""
    origin = np.array(TRUTH.registration.origin)
    return np.array(
        [
            world.readings(origin - np.array([0.0, 0.0, d]), Sphere(3.0), 0.0, (k + 1) * STEP)
            for k, d in enumerate(DEPTH)
        ]
    )


def true_depth(folder):
    return np.array([float(row["depth"]) for row in csv.DictReader((folder / TIP_PATH).read_text().splitlines())])


def test_play_holds_the_tip_back_on_one_way_alone(tmp_path):
    pressed(HiddenWorld(TRUTH, SENSOR, {"play": 0.06}, tmp_path))
    away = DEPTH - true_depth(tmp_path)
    np.testing.assert_allclose(away[5:50], 0.0, atol=2e-3)
    np.testing.assert_allclose(away[60:78], -0.06, atol=2e-3)


def test_a_soft_frame_gives_way_by_force(tmp_path):
    world = HiddenWorld(TRUTH, SENSOR, {"give": 0.05}, tmp_path)
    pressed(world)
    away = DEPTH - true_depth(tmp_path)
    assert away[:5] == pytest.approx(0.0, abs=1e-4) and away[40] > 0.005
    tip = np.array(TRUTH.registration.origin) - [0.0, 0.0, DEPTH[40] - away[40]]
    assert away[40] == pytest.approx(0.05 * world.taxel_force(tip, Sphere(3.0), 0.0).sum(), rel=1e-3)


def test_late_frames_are_those_of_before(tmp_path):
    plain, late = World(TRUTH, SENSOR), HiddenWorld(TRUTH, SENSOR, {"late": 3 * STEP * 1e-9}, tmp_path)
    now, then = pressed(plain), pressed(late)
    np.testing.assert_allclose(then[3:], now[:-3], atol=1.0)


@pytest.mark.parametrize("word", ["play", "play=", "play=-1", "wobble=1", "late=soon"])
def test_what_cannot_be_hidden_is_refused_in_words(word):
    with pytest.raises(UsageError, match="--hide") as caught:
        hidden_from([word])
    assert "play=SIZE, mm" in caught.value.allowed


def test_sizes_are_read():
    assert hidden_from(["play=0.06", "late=0.1"]) == {"play": 0.06, "late": 0.1} and hidden_from([]) == {}
