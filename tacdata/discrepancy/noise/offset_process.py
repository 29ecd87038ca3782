"""Drift of offsets between episodes: an Ornstein-Uhlenbeck process, estimated by REML.

The offset of a stream in an episode is the sum of a level (of its place and session), an Ornstein-Uhlenbeck process in
time, and an independent error. Their variances are estimated by restricted maximum likelihood (REML: Patterson &
Thompson, Biometrika 58, 1971, 545). A straight line in time is a covariate: a drift at a constant rate is an effect to
be tested, and must not enlarge the process. For the same reason measured temperature is a covariate, and the common
part of all channels, such as a warm-up, is left out. REML hardly distinguishes long time constants. Of the likely
ones, the one is taken that gives the rate of a drift the largest variance.

An offset is measured as the mean over the rows without contact. A mean varies less than the process, so covariances
are those of means. The offset to be predicted is the mean over the whole episode.

The innovations of the offsets (by the Cholesky factor of their covariance) are independent over episodes: the part
predicted by earlier offsets is subtracted. So an effect that follows the clock is only significant if it exceeds this
drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

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
MANY_CHANNELS = 8
"""REML: from this number of channels on, their common part is left out."""
SETTLING = (0.7, 1.5, 3.0, 6.0, 12.0)
"""Common drift: rates of exponential settling that are projected out [1 / duration of all episodes]."""
TOGETHER_Z = 1.64
"""Common drift: its variance is larger if it is so many standard errors above that of REML (5 %, one-sided) [1]."""
POINTS = 40
"""Covariance of means: points of time that represent an episode."""
QUIET_ROWS = 3
"""Fewest rows without contact from which the offset of an episode is measured."""
LEAST_OWN = 0.05
"""REML: least standard deviation of the independent error of an offset [noise scales]."""
MOST_OFFSETS = 160
"""REML: most successive episodes that enter; its cost grows with their cube."""
TIME_CONSTANTS = (0.5, 1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 200.0)
"""REML: grid of time constants of the Ornstein-Uhlenbeck process [median times between episodes]."""
LIKELY = 1.0
"""REML: a time constant is likely if its log-likelihood is within this of the best, 84 % one-sided [1]."""


@dataclass(frozen=True)
class OffsetProcess:
    """Prior of episodes' offsets."""

    covariance: np.ndarray
    """Covariance of the means without contact [noise scales squared], shape (episodes, episodes)."""
    cross: np.ndarray
    """Covariance of offsets (means over whole episodes) with these means [the same], shape (episodes, episodes)."""
    variance: np.ndarray
    """Variance of each offset [the same], shape (episodes,)."""
    error: np.ndarray
    """Error variance of each mean by noise [the same], shape (episodes,); inf for episodes without such rows."""
    quiet: np.ndarray
    """Number of readings averaged in each row read without contact, 0 in contact [1], shape (m,)."""
    episode: np.ndarray
    """Episode of each row read, shape (m,), int64."""

    @property
    def weights(self) -> np.ndarray:
        """Weights of earlier means in the prediction of each offset, shape (episodes, episodes), lower triangular."""
        return self._innovations[0]

    @property
    def spread(self) -> np.ndarray:
        """Standard deviation of each offset around its prediction [noise scales], shape (episodes,)."""
        return self._innovations[1]

    @cached_property
    def _innovations(self) -> tuple[np.ndarray, np.ndarray]:
        count, blind = len(self.error), ~np.isfinite(self.error)
        read = self.covariance + np.diag(np.where(blind, 0.0, self.error))
        # An episode without a measured offset has no part in the prediction of the others.
        read[blind] = read[:, blind] = 0.0
        read[blind, blind] = 1.0
        # The first e rows of the inverse factor whiten the means before e: E[o_e | q_<e] = C_e,<e (Q_<e,<e)^-1 q_<e.
        inverse = solve_triangular(cholesky(read, lower=True), np.eye(count), lower=True)
        weights, spread = np.zeros((count, count)), np.zeros(count)
        for e in range(count):
            half = inverse[:e, :e] @ np.where(blind[:e], 0.0, self.cross[e, :e])
            weights[e, :e] = half @ inverse[:e, :e]
            spread[e] = np.sqrt(max(self.variance[e] - float(half @ half), LEAST_OWN**2))
        return weights, spread

    def of(self, rows: np.ndarray, episodes: np.ndarray | None = None) -> OffsetProcess:
        """Return the prior for a part of the rows.

        Args:
            rows: Whether each row is kept, shape (m,), bool.
            episodes: Episodes that are kept, to be renumbered; None keeps all of them.
        """
        number = self.episode[rows]
        if episodes is None:
            present = np.isin(np.arange(len(self.error)), number)
            return replace(self, error=np.where(present, self.error, np.inf), quiet=self.quiet[rows], episode=number)
        among = np.ix_(episodes, episodes)
        return OffsetProcess(
            self.covariance[among],
            self.cross[among],
            self.variance[episodes],
            self.error[episodes],
            self.quiet[rows],
            np.searchsorted(episodes, number),
        )

    def beside(self, course: Course) -> OffsetProcess:
        """Return the prior for a course with readings of more episodes, whose offsets predict no others."""
        return replace(self, quiet=_quiet(course), episode=course.episode)

    def expected(self, values: np.ndarray, missing: np.ndarray | None = None) -> np.ndarray:
        """Return the offsets predicted by those of earlier episodes, shape (episodes, streams, columns).

        Args:
            values: Shape (m, streams, columns).
            missing: Values that were not read, shape (m, streams), bool.
        """
        means = _means(values, self.quiet, self.episode, len(self.error), missing)
        return (self.weights @ means.reshape(len(means), -1)).reshape(means.shape)


def offset_process(
    residual: np.ndarray, course: Course, scale: np.ndarray, memory: float, levels: Sequence[np.ndarray]
) -> OffsetProcess | None:
    """Return the process of the offsets; None if there are too few episodes to estimate it.

    Args:
        residual: Residual of an over-rich fit, shape (m, streams); NaN for missing readings.
        course: Course of the rows read.
        scale: Standard deviation of the innovations of rows, shape (streams,).
        memory: Correlation of successive rows [1].
        levels: For each kind of level (place, session), its number in each episode, shape (episodes,).
    """
    quiet = quiet_rows(course)
    streams = residual[:, : course.channels] / scale[: course.channels]
    missing = ~np.isfinite(streams)
    rows = quiet & ~missing.any(axis=1)
    usable = np.bincount(course.episode[rows], minlength=course.episodes) >= QUIET_ROWS
    count = np.bincount(course.episode[rows], course.averaged[rows], minlength=course.episodes)
    if usable.sum() < FEWEST_OFFSETS:
        return None
    weight = np.where(rows, course.averaged, 0.0)
    offsets = _means(streams[:, :, None], weight, course.episode, course.episodes, None)[:, :, 0]
    # Variance of the mean of n readings of an AR(1) process with correlation m and innovations of variance 1.
    error = np.where(usable, 1 / (np.maximum(count, 1) * (1 - memory) ** 2), np.inf)
    spans = _Spans.of(course, weight)
    kinds, near, warmth = [level[usable] for level in levels], spans.among(usable), _warmth(course)[usable]
    alike, own_way = _shared(offsets[usable], course, scale)
    walk, length, independent = _reml(own_way, error[usable], near, kinds, warmth)
    ratio = _variance_ratio(alike, (walk, length, independent), error[usable], near, kinds, warmth)
    walk, independent = walk * ratio, independent * ratio
    same = FREE_LEVEL**2 * np.sum([level[:, None] == level for level in levels], axis=0)  # only changes are predicted
    nugget = max(independent, LEAST_OWN**2) * np.eye(course.episodes)
    covariance, cross, variance = spans.covariances(length)
    more = same + nugget
    return OffsetProcess(
        walk * covariance + more,
        walk * cross + more,
        walk * variance + np.diag(more),
        error,
        _quiet(course),
        course.episode,
    )


@dataclass(frozen=True)
class _Spans:
    """Times of the two means of each episode: over the rows without contact, and over the whole episode."""

    time: np.ndarray
    """Mean time of each episode [s], shape (episodes,)."""
    quiet: list[np.ndarray]
    """Times without contact, relative to the mean time [s]; empty where there are none."""
    whole: list[np.ndarray]
    """Times of the whole episode, relative to the mean time [s]."""

    @classmethod
    def of(cls, course: Course, weight: np.ndarray) -> _Spans:
        """Return the times of a course; ``weight``: of each row in the mean without contact, shape (m,)."""
        time = _times(course)
        quiet, full, share = [], [], (np.arange(POINTS) + 0.5) / POINTS
        edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
        for first, last in pairwise(edges):
            clock = course.time[first:last]
            clock = clock - float(clock.mean()) if len(clock) else np.zeros(1)
            sums = np.cumsum(weight[first:last])
            is_read = len(sums) > 0 and sums[-1] > 0
            quiet.append(clock[np.searchsorted(sums, share * sums[-1])] if is_read else clock[:0])
            full.append(clock[0] + (clock[-1] - clock[0]) * share)
        return cls(time, quiet, full)

    def among(self, mask: np.ndarray) -> _Spans:
        """Return the times of the first `MOST_OFFSETS` of some episodes; ``mask``: shape (episodes,), bool."""
        numbers = np.flatnonzero(mask)[:MOST_OFFSETS]
        return _Spans(self.time[numbers], [self.quiet[k] for k in numbers], [self.whole[k] for k in numbers])

    def covariances(self, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return covariances of a process of variance 1: of means, of offsets with means, and variances of offsets.

        exp(-|t - s| / length) of times in two episodes is a product of two factors, so no pairs of times are formed.

        Args:
            length: Time constant [s].
        """
        decay = np.exp(-np.maximum(np.subtract.outer(self.time, self.time), 0.0) / length)
        quiet_on, quiet_off, whole_off = (
            np.array([float(np.mean(np.exp(np.clip(sign * at / length, -40, 40)))) if len(at) else 1.0 for at in each])
            for sign, each in ((1, self.quiet), (-1, self.quiet), (-1, self.whole))
        )
        later = np.tril(np.minimum(decay * quiet_on[None, :] * quiet_off[:, None], 1.0), -1)
        within = np.array([_mean_alike(a, a, length) for a in self.quiet])
        cross = np.tril(np.minimum(decay * quiet_on[None, :] * whole_off[:, None], 1.0), -1)
        inside = np.array([_mean_alike(a, b, length) for a, b in zip(self.whole, self.quiet, strict=True)])
        variance = np.array([_mean_alike(a, a, length) for a in self.whole])
        return later + later.T + np.diag(within), cross + np.diag(inside), variance


def _mean_alike(first: np.ndarray, second: np.ndarray, length: float) -> float:
    """Return the covariance of means over two sets of times of one episode, for a process of variance 1."""
    if not (len(first) and len(second)):
        return 1.0
    return float(np.mean(np.exp(-np.abs(np.subtract.outer(first, second)) / length)))


def _shared(offsets: np.ndarray, course: Course, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets in the common directions of all channels, and in all others, shapes (episodes, k).

    A common drift of all channels, or one proportional to their readings at rest, is a systematic effect. Left in, it
    would enlarge the process and then be hidden by it.

    Args:
        offsets: Offsets [noise scales], shape (episodes, channels).
        course: Course of the rows read.
        scale: Standard deviation of the innovations of rows, shape (streams,).
    """
    channels = offsets.shape[1]
    idle, _ = told_at_rest(course)
    shared = [idle] if idle is not None and channels > 1 else []
    if channels >= MANY_CHANNELS:
        shared.append(np.ones(channels))
    if not shared:
        return offsets[:, :0], offsets
    directions = np.stack(shared, axis=1) / scale[:channels, None]
    complement = _complement(directions / np.linalg.norm(directions, axis=0))
    return offsets @ _complement(complement), offsets @ complement


def _variance_ratio(
    shared: np.ndarray,
    process: tuple[float, float, float],
    error: np.ndarray,
    spans: _Spans,
    levels: Sequence[np.ndarray],
    warmth: np.ndarray,
) -> float:
    """Return the variance of the common directions over that of the others [1]; 1 unless it is significantly larger.

    Only common noise counts, which is quick. Slow settling and warm-up are projected out.

    Args:
        shared: Offsets in the common directions [noise scales], shape (episodes, k).
        process: Variance, time constant and error variance by REML from the other directions.
        error: Error variance of each offset [1].
        spans: Times of the episodes.
        levels: Numbers of the levels of each episode.
        warmth: Further covariates of a drift, shape (episodes, k).
    """
    walk, length, independent = process
    sample = shared[:MOST_OFFSETS]
    span = spans.time - spans.time[0]
    rates = np.exp(-np.outer(span, SETTLING) / max(float(span[-1]), 1e-9))
    contrast = _complement(np.column_stack([_slow(spans.time, levels, warmth), rates]))
    if not sample.size or not contrast.shape[1]:
        return 1.0
    read_error = (contrast.T * error[:MOST_OFFSETS]) @ contrast
    process_of = spans.covariances(length)[0]
    model_covariance = walk * contrast.T @ process_of @ contrast + max(independent, LEAST_OWN**2) * np.eye(
        len(read_error)
    )
    contrasts = contrast.T @ sample
    ratio = float(np.sum(contrasts * np.linalg.solve(model_covariance + read_error, contrasts))) / contrasts.size
    if ratio <= 1 + TOGETHER_Z * np.sqrt(2 / contrasts.size):
        return 1.0
    expected = float(np.trace(np.linalg.solve(model_covariance + read_error, model_covariance))) / len(model_covariance)
    return 1 + (ratio - 1) / max(expected, LEAST_OWN)


def _warmth(course: Course) -> np.ndarray:
    """Return the temperature of each episode less its mean [degC], shape (episodes, 1), or (episodes, 0) if unknown."""
    if course.temperature is None:
        return np.zeros((course.episodes, 0))
    count = np.maximum(np.bincount(course.episode, minlength=course.episodes), 1)
    warmth = np.bincount(course.episode, course.temperature, minlength=course.episodes) / count
    return (warmth - warmth.mean())[:, None]


def _quiet(course: Course) -> np.ndarray:
    """Return the number of readings averaged in each row without contact, 0 in contact, shape (m,)."""
    return np.where(quiet_rows(course), course.averaged, 0.0)


def _times(course: Course) -> np.ndarray:
    count = np.maximum(np.bincount(course.episode, minlength=course.episodes), 1)
    time = np.bincount(course.episode, course.time, minlength=course.episodes) / count
    return np.maximum.accumulate(time)


def _means(
    values: np.ndarray, weight: np.ndarray, episode: np.ndarray, episodes: int, missing: np.ndarray | None
) -> np.ndarray:
    """Return the weighted mean over the rows of each episode, shape (episodes, ...); 0 for episodes without rows."""
    rows = np.flatnonzero(weight > 0)
    gone = ~np.isfinite(values[..., 0]) if missing is None else missing
    if gone[rows].any():
        values = np.where(gone[:, :, None], 0.0, values)
    flat = values.reshape(len(values), -1)
    each = csr_array((weight[rows].astype(values.dtype), (episode[rows], rows)), shape=(episodes, len(values)))
    count = (each @ (~gone).astype(float))[:, :, None]
    return (each @ flat).astype(float).reshape(episodes, *values.shape[1:]) / np.where(count > 0, count, 1.0)


def _reml(
    offsets: np.ndarray, error: np.ndarray, spans: _Spans, levels: Sequence[np.ndarray], warmth: np.ndarray
) -> tuple[float, float, float]:
    """Return the variance and time constant [s] of the process by REML, and the variance of the independent error.

    Args:
        offsets: Offsets [noise scales], shape (episodes, channels).
        error: Error variance of each offset [1].
        spans: Times of the episodes.
        levels: Numbers of the levels of each episode.
        warmth: Further covariates of a drift, shape (episodes, k).
    """
    offsets, error, time = offsets[:MOST_OFFSETS], error[:MOST_OFFSETS], spans.time
    basis = _slow(time, levels, warmth)
    contrast = _complement(basis)
    if contrast.shape[1] < FEWEST_OFFSETS // 2:
        return 0.0, 1.0, float(np.var(offsets, axis=0).mean())
    between = max(float(np.median(np.diff(time))), 1e-9)
    contrasts = contrast.T @ offsets
    read_error = (contrast.T * error) @ contrast
    size = max(
        float(np.mean(contrasts**2) - np.trace(read_error) / len(read_error)), 0.01 * float(np.mean(contrasts**2)), 1e-6
    )
    best = []
    for steps in TIME_CONSTANTS:
        alike = spans.covariances(steps * between)[0]
        pattern = contrast.T @ alike @ contrast

        def cost(log: np.ndarray, pattern: np.ndarray = pattern) -> float:
            walk, independent = np.exp(np.clip(log, -14, 14))
            covariance = walk * pattern + read_error + independent * np.eye(len(read_error))
            factor = cho_factor(covariance, lower=True, check_finite=False)
            power = float(np.sum(contrasts * cho_solve(factor, contrasts, check_finite=False)))
            # Half the log of a determinant is the sum of logs of its Cholesky factor's diagonal.
            return contrasts.shape[1] * float(np.log(np.diag(factor[0])).sum()) + 0.5 * power

        optimum = minimize(
            cost, np.log([size, 0.1 * size]), method="Nelder-Mead", options={"maxfev": 80, "xatol": 0.05, "fatol": 0.05}
        )
        walk, independent = (float(v) for v in np.exp(np.clip(optimum.x, -14, 14)))
        matrix = walk * alike + np.diag(error) + max(independent, LEAST_OWN**2) * np.eye(len(time))
        # Of processes about as likely, the one least certain of slow changes: no choice may make a drift significant.
        best.append((float(optimum.fun), _doubt(matrix, basis), (walk, steps * between, independent)))
    smallest = min(value for value, _, _ in best)
    return max((b for b in best if b[0] <= smallest + LIKELY), key=lambda b: b[1])[2]


def _slow(time: np.ndarray, levels: Sequence[np.ndarray], warmth: np.ndarray) -> np.ndarray:
    """Return the covariates of the process: unknown levels, temperature, and last a straight line in time."""
    indicators = [level[:MOST_OFFSETS, None] == np.unique(level[:MOST_OFFSETS]) for level in levels]
    clock = (time - time.mean()) / max(float(np.ptp(time)), 1e-9)
    return np.column_stack(
        [*indicators, warmth[:MOST_OFFSETS] / max(float(np.abs(warmth).max(initial=0.0)), 1e-9), clock]
    )


def _complement(basis: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the orthogonal complement of a basis, shape (n, k)."""
    values, vectors = np.linalg.eigh(basis @ basis.T)
    return vectors[:, values < 1e-9 * values[-1]]


def _doubt(covariance: np.ndarray, basis: np.ndarray) -> float:
    """Return the variance of the last column's coefficient (a drift) by generalized least squares [1]."""
    return float(np.linalg.pinv(basis.T @ np.linalg.solve(covariance, basis), hermitian=True)[-1, -1])
