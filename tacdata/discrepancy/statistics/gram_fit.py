"""Fits, folds and flips of sign on Gram matrices."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

FOLDS = 5
"""Cross-validation: number of folds."""


def solve(gram: np.ndarray, columns: np.ndarray, ridge: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the bounded least-squares coefficients of some columns.

    Args:
        gram: Residual first, shape (1 + p, 1 + p).
        columns: Which columns, shape (k,), counted from 0 without the residual.
        ridge: Weight of a zero-mean prior on each, shape (k,).
        low: Least value of each, shape (k,).
        high: Largest value of each, shape (k,).
    """
    index = columns + 1
    matrix = gram[np.ix_(index, index)] + np.diag(ridge)
    matrix = matrix + 1e-9 * np.eye(len(index)) * max(float(np.trace(matrix)) / max(len(index), 1), 1e-12)
    target = gram[index, 0]
    free = np.linalg.solve(matrix, target)
    if np.all(free >= low) and np.all(free <= high):
        return free
    factor = np.linalg.cholesky(matrix).T
    rest = np.linalg.solve(factor.T, target)
    return lsq_linear(factor, rest, bounds=(low, np.maximum(high, low + 1e-12)), method="bvls").x


def gains(gram: np.ndarray, columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return by how much coefficients lower half the whitened sum of squares of each episode, shape (episodes,)."""
    index = columns + 1
    linear = gram[:, 0, :][:, index] @ values
    square = np.einsum("i,eij,j->e", values, gram[:, index][:, :, index], values)
    return linear - 0.5 * square


def fold_of(episodes: int, seed: int = 0) -> np.ndarray:
    """Return the fold of each episode, shape (episodes,): all folds of a size, shuffled."""
    folds = min(FOLDS, max(episodes, 1))
    return np.random.default_rng([seed, 5]).permutation(np.arange(episodes) % folds)


def flips(episodes: int, count: int, seed: int = 0) -> np.ndarray:
    """Return signs for a randomization test, shape (count, episodes), the first row all +1."""
    signs = np.random.default_rng([seed, 7]).choice([-1.0, 1.0], size=(count, episodes))
    signs[0] = 1.0
    return signs


def eliminated(gram: np.ndarray, columns: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Return each episode's Gram matrix with some columns regressed out by the fit to all episodes.

    Rows and columns of what was taken out become 0.
    """
    if not len(columns):
        return gram
    index = columns + 1
    total = gram.sum(axis=0)
    matrix = total[np.ix_(index, index)] + np.diag(ridge)
    matrix = matrix + 1e-9 * np.eye(len(index)) * max(float(np.trace(matrix)) / len(index), 1e-12)
    through = np.linalg.solve(matrix, total[index])
    half = gram - gram[:, :, index] @ through
    result = half - through.T @ half[:, index]
    result[:, index], result[:, :, index] = 0.0, 0.0
    return result


def t_value(values: np.ndarray) -> float:
    """Return the mean over its standard error, 0 where there is no spread to speak of."""
    spread = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    mean = float(np.mean(values)) if len(values) else 0.0
    return mean / (spread / np.sqrt(len(values))) if spread > 1e-12 else (0.0 if abs(mean) < 1e-12 else np.inf * mean)


LARGEST_RATIO = 6.0
"""Clipped t: largest log-likelihood ratio that one episode contributes [1]."""


def clipped_t(values: np.ndarray) -> float:
    """Return the mean over its standard error with every episode's contribution bounded."""
    return t_value(np.clip(values, -LARGEST_RATIO, LARGEST_RATIO))
