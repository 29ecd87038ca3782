"""Which contact law a foreign skin follows, as episodes that were left out say."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.laws.law import laws
from tacdata.discrepancy.model.response_curve import response_curve


def read_as(rise, seed=0):
    """Return presses whose readings are a function of depth over the stroke, with little noise."""
    made = course(episodes=12, seed=seed)
    depth = np.maximum(made.tip[:, 2], 0) / made.stroke
    noise = 0.002 * np.random.default_rng(seed).normal(size=made.readings.shape)
    return replace(made, readings=5000 + 800 * (rise(depth)[:, None] * np.array([1.0, 0.5, 0.2]) + noise))


@pytest.mark.parametrize(
    ("rise", "words"),
    [
        (lambda d: d, "Winkler"), (lambda d: d**1.5, "Hertz"), (lambda d: d**2.5, "power 2.5"),
        (lambda d: d / (1 - 0.8 * d / 0.77), "gap that closes"),
    ],
)  # fmt: skip
def test_the_law_that_made_the_readings_is_told(rise, words):
    found = response_curve(read_as(rise))
    assert found is not None
    assert words in str(found), str(found)
    assert found.left < 0.01


def test_where_nothing_follows_depth_nothing_is_told():
    made = course(episodes=12)
    loud = 5000 + 100 * np.random.default_rng(0).normal(size=made.readings.shape)
    assert response_curve(replace(made, readings=loud)) is None
    assert response_curve(course(episodes=6)) is None


@pytest.mark.parametrize("law", laws(), ids=lambda law: type(law).__name__)
def test_a_law_begins_at_nothing_and_rises(law):
    depth = np.linspace(0, 1, 50)
    for shape in law.shapes:
        rise = law.rise(depth, shape)
        assert rise[0] == 0
        assert np.all(np.diff(rise) > 0)
