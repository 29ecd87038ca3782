"""Variance components: the size of several kinds of episode errors, estimated together by a robust likelihood."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import minimize, root_scalar
from scipy.stats import chi2

T_FREEDOM = 4.0
"""Degrees of freedom of the t likelihood: a few odd episodes hardly count [1]."""
STARTS = (0.2, 1.0, 3.0)
"""Standard deviations from which the likelihood is climbed [1]."""


def spreads(gaps: np.ndarray, known: np.ndarray, least: float, most: float) -> np.ndarray:
    """Return the standard deviation of each kind of error beyond what is known of it, shape (kinds,).

    Successive errors e of independent kinds differ with covariance 2 diag(s^2) + K, K known: the s of largest
    likelihood, all at once, as kinds that change readings almost alike explain each other. The likelihood is that
    of a multivariate t distribution, scaled to be consistent for normal differences (Maronna, Ann. Stat. 4, 1976).

    Args:
        gaps: Differences of successive errors, shape (n, kinds).
        known: Covariance of each that is known, shape (n, kinds, kinds).
        least: Least spread.
        most: Largest spread.
    """
    kinds = gaps.shape[1]
    scale = T_FREEDOM * _consistent(kinds)

    def unlikely(log: np.ndarray) -> float:
        whole = known + 2 * np.diag(np.exp(2 * log))
        far = np.einsum("nk,nk->n", gaps, np.linalg.solve(whole, gaps[:, :, None])[:, :, 0])
        _, volume = np.linalg.slogdet(whole)
        return float(0.5 * np.sum(volume + (T_FREEDOM + kinds) * np.log1p(far / scale)))

    bounds = [(np.log(least), np.log(most))] * kinds
    tried = [
        minimize(unlikely, np.full(kinds, np.log(np.clip(s, least, most))), method="L-BFGS-B", bounds=bounds)
        for s in STARTS
    ]
    return np.exp(min(tried, key=lambda one: float(one.fun)).x)


def positive(matrices: np.ndarray) -> np.ndarray:
    """Return symmetric matrices (n, k, k) with what is negative of them taken as 0."""
    values, vectors = np.linalg.eigh(0.5 * (matrices + np.swapaxes(matrices, 1, 2)))
    return (vectors * np.maximum(values, 1e-9)[:, None, :]) @ np.swapaxes(vectors, 1, 2)


@cache
def _consistent(kinds: int) -> float:
    """Return the factor of the t distribution's scale that is consistent for normal numbers [1]."""
    at = chi2.ppf((np.arange(4000) + 0.5) / 4000, kinds)

    def bias(scale: float) -> float:
        return float(np.mean((T_FREEDOM + kinds) * at / (T_FREEDOM * scale + at))) - kinds

    return float(root_scalar(bias, bracket=(0.1, 20.0)).root)
