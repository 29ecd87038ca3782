"""How offsets drift from episode to episode: an Ornstein-Uhlenbeck process, estimated by REML.

A stream's offset in an episode is the sum of three parts: a level of its place and session, an Ornstein-Uhlenbeck
process in time, and the episode's own error. Their variances are those of restricted maximum likelihood (REML:
Patterson & Thompson, Biometrika 58, 1971, 545) beside a straight line. REML leaves slow processes undecided: of the
time constants that are likely, the one counts by which a drift is least certain.

Episodes are made independent by their innovations (the Cholesky factor of the offsets' covariance): what the earlier
offsets, read without contact, predict is taken off. An effect that follows the clock must then exceed this drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize
from scipy.sparse import csr_array

from tacdata.chain import Course
from tacdata.chain.at_rest import quiet_rows, told_at_rest

FREE_LEVEL = 1e3
"""Prior standard deviation of an unknown level: practically free [noise scales]."""
FEWEST_OFFSETS = 6
"""REML: with fewer episodes no process is estimated, and every offset is free."""
QUIET_ROWS = 3
"""Rows without contact from which an episode's offset is read, at least."""
LEAST_OWN = 0.05
"""REML: least standard deviation of an episode's own offset [noise scales]."""
MOST_OFFSETS = 160
"""REML: most successive episodes that enter; its cost grows with their cube."""
TIME_CONSTANTS = (0.5, 1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 200.0)
"""REML: time constants of the Ornstein-Uhlenbeck process on a grid [median times between episodes]."""
LIKELY = 1.0
"""REML: a time constant is likely within this log-likelihood of the best, 84 % one-sided [1]."""


@dataclass(frozen=True)
class OffsetProcess:
    """What is known of episodes' offsets before they are read."""

    covariance: np.ndarray
    """Of the offsets as they are [noise scales squared], shape (episodes, episodes)."""
    error: np.ndarray
    """Variance with which each is read where nothing presses [the same], shape (episodes,); inf where none was read."""
    quiet: np.ndarray
    """Rows where nothing presses, of those read, shape (m,), bool."""
    episode: np.ndarray
    """Episode of each row read, shape (m,), int64."""

    @property
    def weights(self) -> np.ndarray:
        """Expected offset of an episode is this times those read, shape (episodes, episodes), lower triangular."""
        return self._innovations[0]

    @property
    def spread(self) -> np.ndarray:
        """Standard deviation of each offset around that [noise scales], shape (episodes,)."""
        return self._innovations[1]

    @cached_property
    def _innovations(self) -> tuple[np.ndarray, np.ndarray]:
        count, blind = len(self.error), ~np.isfinite(self.error)
        read = self.covariance + np.diag(np.where(blind, 0.0, self.error))
        # An episode whose offset cannot be read has no part in the others' prediction.
        read[blind] = read[:, blind] = 0.0
        read[blind, blind] = 1.0
        # Its inverse's rows up to e whiten the offsets before e: E[o_e | q_<e] = C_e,<e (Q_<e,<e)^-1 q_<e.
        inverse = solve_triangular(cholesky(read, lower=True), np.eye(count), lower=True)
        weights, spread = np.zeros((count, count)), np.zeros(count)
        for e in range(count):
            half = inverse[:e, :e] @ np.where(blind[:e], 0.0, self.covariance[e, :e])
            weights[e, :e] = half @ inverse[:e, :e]
            spread[e] = np.sqrt(max(self.covariance[e, e] - float(half @ half), LEAST_OWN**2))
        return weights, spread

    def of(self, rows: np.ndarray, episodes: np.ndarray | None = None) -> OffsetProcess:
        """Return what is known if only some rows were read.

        Args:
            rows: Whether each row is kept, shape (m,), bool.
            episodes: Those that are left, numbered anew; all, unless given.
        """
        number = self.episode[rows]
        if episodes is None:
            there = np.isin(np.arange(len(self.error)), number)
            return replace(self, error=np.where(there, self.error, np.inf), quiet=self.quiet[rows], episode=number)
        return OffsetProcess(
            self.covariance[np.ix_(episodes, episodes)], self.error[episodes], self.quiet[rows],
            np.searchsorted(episodes, number),
        )  # fmt: skip

    def beside(self, course: Course) -> OffsetProcess:
        """Return it for a course with readings of more episodes: their offsets let no others be expected."""
        return replace(self, quiet=quiet_rows(course), episode=course.episode)

    def expected(self, values: np.ndarray, missing: np.ndarray | None = None) -> np.ndarray:
        """Return the offsets that those of the episodes before let one expect, shape (episodes, streams, columns).

        Args:
            values: Shape (m, streams, columns).
            missing: Values that were not read, shape (m, streams), bool.
        """
        means = _means(values, self.quiet, self.episode, len(self.error), missing)
        return (self.weights @ means.reshape(len(means), -1)).reshape(means.shape)


def offset_process(
    residual: np.ndarray, course: Course, scale: np.ndarray, memory: float, levels: Sequence[np.ndarray]
) -> OffsetProcess | None:  # fmt: skip
    """Return how offsets drift; None if there are too few episodes to estimate it.

    Args:
        residual: What an over-rich fit leaves, shape (m, streams); NaN where nothing was read.
        course: With the rows read alone.
        scale: Standard deviation of the innovations of rows, shape (streams,).
        memory: Correlation of successive rows [1].
        levels: Kinds of unknown levels, each as the number of the one that an episode has, shape (episodes,).
    """
    quiet = quiet_rows(course)
    streams = residual[:, : course.channels] / scale[: course.channels]
    missing = ~np.isfinite(streams)
    there = quiet & ~missing.any(axis=1)
    count = np.bincount(course.episode[there], minlength=course.episodes)
    known = count >= QUIET_ROWS
    if known.sum() < FEWEST_OFFSETS:
        return None
    offsets = _means(streams[:, :, None], there, course.episode, course.episodes, None)[:, :, 0]
    # The mean of n rows with memory m and innovations of variance 1.
    error = np.where(known, 1 / (np.maximum(count, 1) * (1 - memory) ** 2), np.inf)
    time = _times(course)
    own_way = _without_gain(offsets, course, scale)
    walk, length, own = _reml(own_way[known], error[known], time[known], [level[known] for level in levels])
    apart = np.abs(np.subtract.outer(time, time))
    same = np.sum([level[:, None] == level for level in levels], axis=0)
    covariance = walk * np.exp(-apart / length) + FREE_LEVEL**2 * same + max(own, LEAST_OWN**2) * np.eye(len(time))
    return OffsetProcess(covariance, error, quiet, course.episode)


def _without_gain(offsets: np.ndarray, course: Course, scale: np.ndarray) -> np.ndarray:
    """Return offsets in all directions but the one that a gain of whole readings has, shape (episodes, k).

    A gain that drifts changes readings at rest by one factor. It is no chance, and would hide in the process.

    Args:
        offsets: In noise scales, shape (episodes, channels).
        course: With the rows read alone.
        scale: Standard deviation of the innovations of rows, shape (streams,).
    """
    idle, _ = told_at_rest(course)
    if idle is None or len(idle) < 2:
        return offsets
    along = (idle / scale[: len(idle)])[:, None]
    return offsets @ np.linalg.qr(along, mode="complete")[0][:, 1:]


def _times(course: Course) -> np.ndarray:
    count = np.maximum(np.bincount(course.episode, minlength=course.episodes), 1)
    time = np.bincount(course.episode, course.time, minlength=course.episodes) / count
    return np.maximum.accumulate(time)


def _means(
    values: np.ndarray, rows: np.ndarray, episode: np.ndarray, episodes: int, missing: np.ndarray | None
) -> np.ndarray:
    """Return the means of some rows of each episode, shape (episodes, ...), 0 where there are none."""
    gone = ~np.isfinite(values[..., 0]) if missing is None else missing
    if gone[rows].any():
        values = np.where(gone[:, :, None], 0.0, values)
    flat, chosen = values.reshape(len(values), -1), np.flatnonzero(rows)
    each = csr_array(
        (np.ones(len(chosen), dtype=values.dtype), (episode[chosen], chosen)), shape=(episodes, len(values))
    )
    count = (each @ (~gone).astype(float))[:, :, None]
    return (each @ flat).astype(float).reshape(episodes, *values.shape[1:]) / np.maximum(count, 1)


def _reml(
    offsets: np.ndarray, error: np.ndarray, time: np.ndarray, levels: Sequence[np.ndarray]
) -> tuple[float, float, float]:  # fmt: skip
    """Return the REML variance and time constant [s] of the process, and the variance of episodes' own offsets.

    Args:
        offsets: In noise scales, shape (episodes, channels).
        error: Variance of each that is known [1].
        time: Of each [s].
        levels: Of each.
    """
    offsets, error, time = offsets[:MOST_OFFSETS], error[:MOST_OFFSETS], time[:MOST_OFFSETS]
    clock = (time - time.mean()) / max(float(np.ptp(time)), 1e-9)
    # A line beside levels that are not known: a drift is no evidence of the process.
    few = [level[:MOST_OFFSETS] for level in levels]
    basis = np.column_stack([*(level[:, None] == np.unique(level) for level in few), clock])
    values, vectors = np.linalg.eigh(basis @ basis.T)
    kept = values < 1e-9 * values[-1]
    contrast = vectors[:, kept]
    if contrast.shape[1] < FEWEST_OFFSETS // 2:
        return 0.0, 1.0, float(np.var(offsets, axis=0).mean())
    apart = np.abs(np.subtract.outer(time, time))
    between = max(float(np.median(np.diff(time))), 1e-9)
    seen = contrast.T @ offsets
    read_error = (contrast.T * error) @ contrast
    size = max(float(np.mean(seen**2) - np.trace(read_error) / len(read_error)), 0.01 * float(np.mean(seen**2)), 1e-6)
    best = []
    for steps in TIME_CONSTANTS:
        alike = np.exp(-apart / (steps * between))
        pattern = contrast.T @ alike @ contrast

        def cost(log: np.ndarray, pattern: np.ndarray = pattern) -> float:
            walk, own = np.exp(np.clip(log, -14, 14))
            covariance = walk * pattern + read_error + own * np.eye(len(read_error))
            factor = cho_factor(covariance, lower=True, check_finite=False)
            power = float(np.sum(seen * cho_solve(factor, seen, check_finite=False)))
            return seen.shape[1] * float(np.log(np.diag(factor[0])).sum()) + 0.5 * power

        found = minimize(cost, np.log([size, 0.1 * size]), method="Nelder-Mead",
                         options={"maxfev": 80, "xatol": 0.05, "fatol": 0.05})  # fmt: skip
        walk, own = (float(v) for v in np.exp(np.clip(found.x, -14, 14)))
        matrix = walk * alike + np.diag(error) + max(own, LEAST_OWN**2) * np.eye(len(time))
        best.append((float(found.fun), _doubt(matrix, basis), (walk, steps * between, own)))
    least = min(value for value, _, _ in best)
    return max((b for b in best if b[0] <= least + LIKELY), key=lambda b: b[1])[2]


def _doubt(covariance: np.ndarray, basis: np.ndarray) -> float:
    """Return the variance of the last column's weight beside the others, for offsets of a covariance [1]."""
    return float(np.linalg.pinv(basis.T @ np.linalg.solve(covariance, basis), hermitian=True)[-1, -1])
