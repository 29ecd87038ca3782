"""Tests of fits on Gram matrices: beside columns without bounds they are those of all columns together."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tacdata.discrepancy.statistics.gram_fit import Beside, bounded, gains, solve


@pytest.mark.parametrize("seed", range(20))
def test_bounds_are_kept_as_by_bounded_least_squares(seed):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(60, 12)) @ rng.normal(size=(12, 12)) * 10.0 ** rng.uniform(-2, 2, size=12)
    target = rng.normal(size=60) + columns @ (rng.normal(size=12) / np.linalg.norm(columns, axis=0)) * 3
    low, high = -rng.uniform(0, 0.05, size=12), rng.uniform(0, 0.05, size=12)
    low[:3] = -np.inf
    wanted = lsq_linear(columns, target, bounds=(low, high), method="bvls", tol=1e-14).x
    found = bounded(columns.T @ columns, columns.T @ target, low, high)
    assert np.all(found >= low)
    assert np.all(found <= high)
    assert np.linalg.norm(columns @ (found - wanted)) < 1e-7 * np.linalg.norm(target)


def test_a_fit_beside_free_columns_is_the_fit_of_all():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(8, 50, 10)) * 10.0 ** rng.uniform(-0.5, 0.5, size=10)
    gram = values.transpose(0, 2, 1) @ values
    free, own, train, rest = np.arange(4, 9), np.array([1, 3]), np.arange(5), np.arange(5, 8)
    ridge, weak = rng.uniform(0.1, 10, size=5), np.full(2, 1e-6)
    for bound in (np.inf, 1e-3):
        low, high = np.full(2, -bound), np.full(2, bound)
        everywhere = np.full(5, np.inf)
        wanted = solve(
            gram[train].sum(axis=0),
            np.concatenate([own, free]),
            np.concatenate([weak, ridge]),
            np.concatenate([low, -everywhere]),
            np.concatenate([high, everywhere]),
        )
        beside = Beside(gram, gram[train].sum(axis=0), free, ridge)
        found = beside.fit(own, weak, low, high)
        assert np.allclose(np.concatenate(found), wanted, rtol=1e-6, atol=1e-9)
        told = gains(gram[rest], np.concatenate([own, free]), wanted)
        assert np.allclose(beside.gains(own, found[0], rest), told, rtol=1e-6, atol=1e-6 * np.abs(told).max())
