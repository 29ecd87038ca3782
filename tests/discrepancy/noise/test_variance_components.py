"""How large errors of several kinds are is told from noisy differences, all kinds together."""

import numpy as np
import pytest

from tacdata.discrepancy.noise.variance_components import positive, spreads


def differences(sizes, known, count, seed=0):
    """Differences of successive errors that were told with a known covariance."""
    rng = np.random.default_rng(seed)
    noise = rng.multivariate_normal(np.zeros(len(sizes)), known, size=count)
    return rng.normal(size=(count, len(sizes))) * np.sqrt(2) * sizes + noise


@pytest.mark.parametrize("sizes", [(0.4, 0.2), (1.5, 0.1), (0.3, 2.0)])
def test_kinds_that_change_readings_almost_alike_are_told_apart(sizes):
    """Depth and gain of a press: what tells one is uncertain by what tells the other, at a correlation of -0.95."""
    known = np.array([[0.25, -0.95 * 0.5], [-0.95 * 0.5, 1.0]])
    told = np.array([
        spreads(differences(np.array(sizes), known, 400, seed), np.tile(known, (400, 1, 1)), 0.05, 10.0)
        for seed in range(10)
    ])  # fmt: skip
    assert told.mean(axis=0) == pytest.approx(sizes, rel=0.15, abs=0.1)


def test_a_few_episodes_unlike_all_others_do_not_decide():
    known = np.tile(np.diag([0.01, 0.01]), (60, 1, 1))
    gaps = differences(np.array([0.5, 0.5]), known[0], 60)
    gaps[:4] *= 30
    assert spreads(gaps, known, 0.05, 10.0) == pytest.approx([0.5, 0.5], rel=0.35)


def test_covariances_that_rounding_made_negative_are_none():
    assert np.linalg.eigvalsh(positive(np.diag([1.0, -0.2])[None]))[0].min() >= 0
