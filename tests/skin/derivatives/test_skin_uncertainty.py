"""Spreads of parameters to standard deviations of maps and forces."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import FormatError, UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import Sensor, default_sensor
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.derivatives.uncertainty import propagate, sampled_spread, uncertainties
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

SPREADS = {"x": 0.05, "z": 0.01, "tilt_x": 0.5, "thickness": 0.05, "youngs_modulus": 0.02, "poisson_ratio": 0.005}
DEEP = PressRequest(Sphere(2.0), 0.13, -0.21, 0.0, (0.2, 0.4))


@pytest.fixture(scope="module")
def skin():
    sensor = replace(slab_sensor(size=4.0, pixels=9), uncertainty=SPREADS)
    settings = ModelSettings(error_estimate=False, step=0.45)
    return SkinModel(sensor, settings, mesh=box_mesh(sensor, 6, 6, 2))


def test_one_spread_is_the_derivative_times_it_and_several_add_in_squares(skin):
    [(_, _, found)] = sensitivities(skin, replace(DEEP, depths=(0.3,)), ["z", "youngs_modulus"])
    alone = propagate(found, {"z": 0.01})
    assert np.allclose(alone.surface, 0.01 * np.abs(found.surface[0]))
    both = propagate(found, {"z": 0.01, "youngs_modulus": 0.02})
    assert both.force[2] == pytest.approx(np.hypot(0.01 * found.force[0, 2], 0.02 * found.force[1, 2]))
    with pytest.raises(UsageError, match="friction"):
        propagate(found, {"friction": 0.1})


@pytest.mark.long("tacdata/skin", reason="64 presses drawn at random")
def test_the_sensor_files_spreads_agree_with_presses_drawn_at_random(skin):
    """64 presses tell a standard deviation to 9 %; two and a half of these, and the press is not quite linear."""
    samples = sampled_spread(skin, DEEP, SPREADS, 64, seed=1, capacity=32)
    for (depth, _, first), (same, drawn) in zip(uncertainties(skin, DEEP), samples, strict=True):
        assert depth == same
        assert drawn.force[2] == pytest.approx(first.force[2], rel=0.22)
        largest = first.surface.max()
        # At the contact's edge a single pixel's derivative follows single elements.
        apart = np.abs(drawn.surface - first.surface) / largest
        assert np.quantile(apart, 0.98) < 0.25 and apart.max() < 0.6
        assert drawn.surface.mean() == pytest.approx(first.surface.mean(), rel=0.22)


def test_a_place_known_to_the_size_of_the_contact_is_beyond_the_first_order(skin):
    """Under the tip depth falls with the square of a shift, x^2 / 2R = 0.04 mm at 0.4 mm, and has no slope."""
    centred, spreads = replace(DEEP, x=0.0, y=0.0, depths=(0.4,)), {"x": 0.4}
    [(_, _, first)] = uncertainties(skin, centred, spreads)
    [(_, drawn)] = sampled_spread(skin, centred, spreads, 32, capacity=32)
    assert drawn.surface[4, 4] > 0.02
    assert first.surface[4, 4] < 0.5 * drawn.surface[4, 4]
    # On the flanks, whose slope does not go on for 0.4 mm, it says too much.
    assert first.surface.max() > 1.3 * drawn.surface.max()


def test_spreads_are_refused_in_words(skin):
    for spreads in ({}, {"z": -0.1}, {"z": float("nan")}, {"glue": 0.1}, {"friction": 0.05}):
        with pytest.raises(UsageError):
            list(uncertainties(skin, DEEP, spreads))
    with pytest.raises(UsageError, match="at least 2"):
        sampled_spread(skin, DEEP, {"z": 0.1}, 1)


def test_spreads_in_a_sensor_file_change_no_label():
    sensor = replace(default_sensor(), uncertainty={})
    assert "uncertainty" not in sensor.document
    with_spreads = {**sensor.document, "uncertainty": {"thickness": 0.2}}
    read = Sensor.from_document(with_spreads, "file")
    assert read.uncertainty == {"thickness": 0.2} and read.content_hash == sensor.content_hash
    assert read.document["uncertainty"] == {"thickness": 0.2}
    with pytest.raises(FormatError, match="uncertainty"):
        Sensor.from_document({**with_spreads, "uncertainty": {"thickness": -0.2}}, "file")
