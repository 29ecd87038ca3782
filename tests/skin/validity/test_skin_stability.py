"""Drucker's test against closed forms, and in the words that a person reads."""

import numpy as np
import pytest

from tacdata import registry
from tacdata.sensor.sensor import Material
from tacdata.skin.validity.law_stability import instabilities, stable_ranges

STEP = 2 ** (1 / 60)
"""Ratio of neighbouring stretches that are tried."""


def yeoh_limit(c2):
    """Stretch beyond which the equibiaxial slope of stress is negative, from its closed form and a fine search."""
    stretch = np.linspace(1.0, 2.0, 200001)
    x = 2 * stretch**2 + stretch**-4 - 3
    # d tau / d ln l for tau = 2 W' (l^2 - l^-4), W' = (1 + 2 c2 x) / 2
    tau = (1 + 2 * c2 * x) * (stretch**2 - stretch**-4)
    return stretch[1 + np.argmax(np.diff(tau) < 0)]


@pytest.mark.parametrize("law", ["neo_hookean", "neo_hookean_log"])
def test_a_law_without_parameters_is_stable(law):
    assert instabilities(Material(law, 0.3, 0.47), stretch=3.0) == []


@pytest.mark.parametrize("law", registry.names("tacdata.skin.materials", "law"))
def test_defaults_are_stable(law):
    assert instabilities(Material(law, 0.3, 0.47)) == []


def test_the_limit_of_a_softening_yeoh_law_is_found():
    c2 = -0.1
    found = {r.path: r for r in stable_ranges(Material("yeoh", 0.3, 0.47, {"c2_over_c1": c2}))}
    limit = yeoh_limit(c2)
    assert limit / STEP**2 < found["equibiaxial"].highest <= limit
    # Pulling in two directions is pressing in the third.
    assert found["uniaxial"].lowest ** -0.5 == pytest.approx(2**0.5)
    assert found["equibiaxial"].lowest > 0.5
    assert found["uniaxial"].highest == pytest.approx(2.0)


def test_the_words_name_law_parameter_path_and_stretch():
    words = instabilities(Material("yeoh", 0.3, 0.47, {"c2_over_c1": -0.1}))
    assert any(
        "yeoh with c2_over_c1 = -0.1" in w and "equibiaxial" in w and "above 1.50" in w and "0.50 to 2.00" in w
        for w in words
    )


def test_a_third_term_makes_it_stable_again():
    assert instabilities(Material("yeoh", 0.3, 0.47, {"c2_over_c1": -0.1, "c3_over_c1": 0.01})) == []


def test_it_does_not_depend_on_stiffness_or_compressibility():
    a, b = (
        stable_ranges(Material("ogden", e, nu, {"exponent": [2, -2], "share": [1.2, -0.2]}))
        for e, nu in ((0.3, 0.47), (50.0, 0.3))
    )
    assert a == b
    assert a[1].highest < 2.0
