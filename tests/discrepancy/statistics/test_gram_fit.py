"""Tests of fits on Gram matrices."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tacdata.discrepancy.statistics.gram_fit import bounded


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
