"""Fits, folds and flips of sign on Gram matrices."""

from __future__ import annotations

import numpy as np

FOLDS = 5
"""Cross-validation: number of folds."""
JITTER = 1e-9
"""Weight on every coefficient, over the mean information of a column: some may be collinear [1]."""
MOST_SETS = 10
"""Active sets: most steps for each coefficient..."""
SETTLED = 1e-10
"""...which end where no slope that points inside is larger [largest slope at 0]."""


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
    matrix = matrix + JITTER * np.eye(len(index)) * max(float(np.trace(matrix)) / max(len(index), 1), 1e-12)
    return bounded(matrix, gram[index, 0], low, np.maximum(high, low + 1e-12))


def bounded(matrix: np.ndarray, target: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the x between bounds that has the least x' matrix x / 2 - target' x, shape (k,).

    Active sets, as in Stark & Parker (Computational Statistics 10, 1995, 129): those held at a bound are let go one by
    one where the slope points inside; a step ends at the first bound in its way.

    Args:
        matrix: Positive definite, shape (k, k).
        target: Shape (k,).
        low: Least values, shape (k,).
        high: Largest values, shape (k,), above the least.
    """
    best = np.linalg.solve(matrix, target)
    if np.all(best >= low) and np.all(best <= high):
        return best
    x = np.clip(best, low, high)
    fixed = x != best
    diagonal = np.diag(matrix)
    size = np.sqrt(np.where(diagonal > 0, diagonal, np.inf))  # by round-off a column without information is below 0
    for _ in range(MOST_SETS * len(x)):
        interior = np.flatnonzero(~fixed)
        step = np.zeros(len(x))
        step[interior] = np.linalg.solve(matrix[np.ix_(interior, interior)], target[interior] - matrix[interior] @ x)
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (high - x) / step, np.where(step < 0, (low - x) / step, np.inf))
        share = min(float(room.min()), 1.0)
        x = np.clip(x + share * step, low, high)
        if share < 1:
            first = int(np.argmin(room))
            x[first], fixed[first] = (high if step[first] > 0 else low)[first], True
            continue
        slope = (target - matrix @ x) / size
        inward = np.where(fixed, np.where(x <= low, slope, -slope), 0.0)
        if inward.max() <= SETTLED * np.abs(target / size).max():
            break
        fixed[int(np.argmax(inward))] = False
    return x


def fold_of(episodes: int, seed: int = 0) -> np.ndarray:
    """Return the fold of each episode, shape (episodes,): all folds of a size, shuffled."""
    folds = min(FOLDS, max(episodes, 1))
    return np.random.default_rng([seed, 5]).permutation(np.arange(episodes) % folds)


def flips(episodes: int, count: int, seed: int = 0) -> np.ndarray:
    """Return signs for a randomization test, shape (count, episodes), the first row all +1."""
    signs = np.random.default_rng([seed, 7]).choice([-1.0, 1.0], size=(count, episodes))
    # The recordings as they are belong to the null distribution: a p-value is never 0.
    signs[0] = 1.0
    return signs


def eliminated(gram: np.ndarray, columns: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Return each episode's Gram matrix with some columns regressed out by the fit to all episodes.

    Rows and columns of the removed ones become 0.
    """
    if not len(columns):
        return gram
    index = columns + 1
    total = gram.sum(axis=0)
    matrix = total[np.ix_(index, index)] + np.diag(ridge)
    matrix = matrix + JITTER * np.eye(len(index)) * max(float(np.trace(matrix)) / len(index), 1e-12)
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
