"""How far offsets are trusted: a wander's own slope must not pass for drift, and a real drift must stay one."""

import numpy as np
import pytest

from tacdata.discrepancy.noise import _as_wander


def slope_errors(made, count):
    """Return the spread of slopes of offsets, and what independent offsets of the told spread would give."""
    place = np.arange(count) - (count - 1) / 2
    slopes = np.concatenate([place @ one for one in made]) / np.sum(place**2)
    told = np.median([_as_wander(one) for one in made])
    return float(np.std(slopes)), float(told / np.sqrt(np.sum(place**2)))


@pytest.mark.parametrize("count", [10, 24, 48, 100])
def test_a_wander_makes_slopes_as_uncertain_as_it_says(count):
    rng, keep = np.random.default_rng(1), np.exp(-6 / 40)
    made = []
    for _ in range(40):
        offsets = np.empty((count, 24))
        now = rng.normal(size=24)
        for k in range(count):
            offsets[k] = now
            now = keep * now + np.sqrt(1 - keep**2) * rng.normal(size=24)
        made.append(offsets)
    true, told = slope_errors(made, count)
    assert 0.6 * true < told < 1.6 * true


@pytest.mark.parametrize("change", ["nothing", "line", "warming"])
def test_independent_offsets_and_smooth_changes_are_no_wander(change):
    rng, time = np.random.default_rng(2), np.linspace(0, 1, 48)[:, None]
    more = {"nothing": 0 * time, "line": 3 * time, "warming": 3 * (1 - np.exp(-5 * time))}[change]
    found = [_as_wander(0.3 * rng.normal(size=(48, 24)) + more) for _ in range(20)]
    assert np.quantile(found, 0.9) < 0.3
