"""Which contact law a foreign skin follows, as episodes that were left out say."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model import response_curve as curve
from tacdata.discrepancy.model.laws.law import between, laws
from tacdata.discrepancy.model.response_curve import response_curve


def read_as(rise, seed=0, made=None):
    """Return presses whose channels (n, 3) are functions of depth over the stroke, with little noise."""
    made = made or course(episodes=12, seed=seed)
    depth = np.maximum(made.tip[:, 2:], 0) / made.stroke
    noise = 0.002 * np.random.default_rng(seed).normal(size=made.readings.shape)
    return replace(made, readings=5000 + 800 * (rise(depth) * np.array([1.0, 0.5, 0.2]) + noise))


@pytest.mark.parametrize(
    ("rise", "words"),
    [
        (lambda d: d, "Winkler"),
        (lambda d: d**1.5, "Hertz"),
        (lambda d: d**2.5, "to the power 2."),
        (lambda d: d / (1 - 0.8 * d / 0.77), "gap that closes"),
    ],
)
def test_the_law_that_made_the_readings_is_told(rise, words):
    found = response_curve(read_as(rise))
    assert found is not None
    assert words in str(found), str(found)
    assert found.left < 1.1 * found.splines


@pytest.mark.parametrize("seed", range(4))
def test_each_channel_has_a_power_of_its_own(seed):
    found = response_curve(read_as(lambda d: d ** np.array([1.2, 1.6, 2.0]), seed))
    assert type(found.law).__name__ == "PowerLaw"
    assert found.numbers == pytest.approx((1.2, 2.0), abs=0.15)
    assert found.left < 1.1 * found.splines


@pytest.mark.parametrize("seed", range(4))
def test_splines_are_no_worse_where_readings_bend_as_no_law_does(seed):
    found = response_curve(read_as(lambda d: d**1.4 + 0.02 * np.sin(12 * d), seed))
    assert found.worse
    assert found.left > 1.5 * found.splines
    assert "no better" not in str(found)


@pytest.mark.parametrize("seed", (1, 2, 3))
def test_an_episode_deeper_than_the_others_is_not_asked(monkeypatch, seed):
    """Splines know nothing there: any law would seem as good."""
    made = course(episodes=16, seed=seed)
    only = np.unique(made.episode[made.tip[:, 2] > 0.9 * made.tip[:, 2].max()])[1:]
    tip = made.tip.copy()
    tip[np.isin(made.episode, only), 2] *= 0.7
    one_deep = read_as(lambda d: d**1.4 + 0.02 * np.sin(12 * d), seed, replace(made, tip=tip))
    assert response_curve(one_deep).worse
    monkeypatch.setattr(curve, "DEEPER", np.inf)
    assert not response_curve(one_deep).worse


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


def test_a_number_is_told_once_and_a_range_from_end_to_end():
    assert between(1.5, 1.5) == "1.5"
    assert between(1.2, 1.75) == "1.2 to 1.8"
