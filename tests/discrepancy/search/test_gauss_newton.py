"""Intervals of numbers hold what they say, however few episodes tell them; where an equation ends is told."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tacdata.discrepancy.noise.gram import EpisodeGrams
from tacdata.discrepancy.regressors.tangent import knobs_of
from tacdata.discrepancy.search.gauss_newton import Refined, _covariance
from tacdata.effects import Placed, load

Z90 = 1.645


def held(episodes, heavy, rng, draws=600, excess=2.0):
    """Return the share of 90 % intervals that hold the truth: a number beside two others, episodes of unlike weight."""
    inside = 0
    for _ in range(draws):
        size = np.where(np.arange(episodes) < heavy, 3.0, 0.5)
        columns = rng.normal(size=(episodes, 12, 3)) * size[:, None, None]
        columns[:, :, 1] += 0.5 * columns[:, :, 0]
        # Episodes err by more than the noise that they were whitened by, and by themselves.
        residual = rng.normal(size=(episodes, 12)) + excess * rng.normal(size=(episodes, 1)) * columns[:, :, 0] / 4
        whole = np.concatenate([residual[:, :, None], columns], axis=2)
        found = EpisodeGrams(np.einsum("eni,enj->eij", whole, whole), np.full(episodes, 12.0))
        total = found.gram.sum(axis=0)
        best = np.linalg.solve(total[1:, 1:], total[1:, 0])
        error = np.sqrt(_covariance(found, best, np.zeros(3), 1)[0, 0])
        inside += abs(best[0]) <= Z90 * error
    return inside / draws


@pytest.mark.parametrize(("episodes", "heavy"), [(40, 40), (40, 5), (10, 10), (10, 4)])
def test_intervals_hold_nine_in_ten(episodes, heavy):
    assert held(episodes, heavy, np.random.default_rng(5)) == pytest.approx(0.9, abs=0.045)


def test_nothing_placed_has_no_covariance():
    assert _covariance(EpisodeGrams(np.zeros((4, 1, 1)), np.ones(4)), np.zeros(0), np.zeros(0), 0).shape == (0, 0)


@pytest.mark.parametrize(
    ("w", "error", "told"), [(0.01, 0.2, ("w",)), (0.01, 0.9, ()), (0.02, 0.2, ())], ids=["known", "unknown", "inside"]
)
def test_an_equation_ends_at_a_lower_bound_that_is_known(w, error, told):
    """What is not known there makes no difference below."""
    placed = (Placed(load("bouc_wen"), {"a": np.array(0.2), "w": np.array(w)}),)
    model = SimpleNamespace(placed=placed, knobs=knobs_of(placed, 1), covariance=np.diag([0.1**2, error**2]))
    assert Refined.narrowest(cast(Any, model), 0) == told
