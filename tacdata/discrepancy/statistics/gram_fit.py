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


class Beside:
    """Gram matrices given columns that are free of bounds: these are taken out once, and fits are of a few columns."""

    def __init__(self, gram: np.ndarray, total: np.ndarray, columns: np.ndarray, ridge: np.ndarray) -> None:
        """Take them out.

        Args:
            gram: Of each episode, residual first, shape (episodes, 1 + p, 1 + p).
            total: Of the episodes that are fitted, shape (1 + p, 1 + p).
            columns: Those that are free, counted from 0 without the residual, shape (f,).
            ridge: Weight of a zero-mean prior on each, shape (f,).
        """
        self._gram, self._index = gram, columns + 1
        self._kept = np.setdiff1d(np.arange(len(total)), self._index)
        self._at = np.searchsorted(self._kept, np.arange(len(total)))
        matrix = total[np.ix_(self._index, self._index)] + np.diag(ridge)
        self._trace = float(np.trace(matrix))
        matrix = matrix + JITTER * np.eye(len(columns)) * max(self._trace / max(len(columns), 1), 1e-12)
        self._through = np.linalg.solve(matrix, total[self._index])
        self._rest = total - total[:, self._index] @ self._through
        self._left: dict[bytes, np.ndarray] = {}

    def fit(
        self, columns: np.ndarray, ridge: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients of some columns as `solve` does, and those of the free ones."""
        index = columns + 1
        matrix = self._rest[np.ix_(index, index)] + np.diag(ridge)
        # The mean over all columns, the free ones included: `solve` adds the same jitter to all of them at once.
        mean = (float(np.trace(matrix)) + self._trace) / max(len(index) + len(self._index), 1)
        matrix = matrix + JITTER * np.eye(len(index)) * max(mean, 1e-12)
        values = bounded(matrix, self._rest[index, 0], low, np.maximum(high, low + 1e-12))
        return values, self._through[:, 0] - self._through[:, index] @ values

    def gains(self, columns: np.ndarray, values: np.ndarray, episodes: np.ndarray) -> np.ndarray:
        """Return the decrease of half the sum of squares of episodes by coefficients and the free ones."""
        key, index = np.asarray(episodes).tobytes(), self._at[columns + 1]
        if key not in self._left:
            self._left[key] = self._without(self._gram[episodes])
        remainder = self._left[key]
        linear = remainder[:, 0, :][:, index] @ values
        square = np.einsum("i,eij,j->e", values, remainder[:, index[:, None], index], values)
        return 0.5 * (self._gram[episodes, 0, 0] - remainder[:, 0, 0]) + linear - 0.5 * square

    def _without(self, gram: np.ndarray) -> np.ndarray:
        """Return Gram matrices of the other columns after projecting out the free ones."""
        through = self._through[:, self._kept]
        # `take` copies whole rows, in half the time of an index.
        half = np.take(gram, self._kept, axis=2) - np.take(gram, self._index, axis=2) @ through
        return np.take(half, self._kept, axis=1) - through.T @ np.take(half, self._index, axis=1)


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
    half = gram - np.take(gram, index, axis=2) @ through
    result = half - through.T @ np.take(half, index, axis=1)
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
