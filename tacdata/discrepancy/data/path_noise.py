"""The tip's path without the noise that its position was measured with."""

from __future__ import annotations

import numpy as np

from tacdata.chain.spikes import without_spikes

WINDOWS = (2, 4, 8, 16, 32, 64)
"""Rows on either side that a straight line is laid through [1]."""
AGREE_Z = 2.0
"""Estimates of two windows agree within so many of their standard errors [1]."""
LEAST_NOISE = 1e-5
"""Less noise is none [mm]."""
CORNER = 0.02
"""Where a path turns by more between its positions than this share of its stroke, nobody knows how it turned [1]."""

DROPOUT = 0.05
"""A position that jumps there and back by this share of the stroke is a dropout [1]..."""
MOST_LOST = 0.02
"""...if no larger a share of a sampled path does so [1]..."""
FEWEST_SAMPLED = 100
"""...of so many positions, at least: a path that is given by its corners turns at single ones."""
FEWEST_POSITIONS = 20
"""Fewer positions estimate no noise."""
REGULAR = 0.9
"""Share of the steps of a sampled path that are no longer than twice the median [1]."""


def without_noise(time_ns: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a path smoothed, and the noise that it was measured with.

    A position that dithers while the tool rests resembles play, which the readings do not follow. Every position is
    estimated by a straight line through its neighbours. The window is the widest that agrees with all narrower ones:
    intersection of confidence intervals (Goldenshluger & Nemirovski, Math. Methods Stat. 6, 1997, 135). Commands have
    no noise and stay, and so does a path that is given by its corners.

    Args:
        time_ns: Of each position [ns], increasing, shape (n,).
        path: Positions [mm], shape (n, 3).

    Returns:
        Positions [mm], shape (n, 3), and the standard deviation of their noise [mm], shape (3,).
    """
    if len(path) < FEWEST_POSITIONS or not _sampled(time_ns):
        return path, np.zeros(3)
    time = (time_ns - time_ns[0]) * 1e-9
    noise = np.array([_noise(time, axis) for axis in path.T])
    axes = [_smoothed(time, axis, s) if s > LEAST_NOISE else axis for axis, s in zip(path.T, noise, strict=True)]
    return np.column_stack(axes), np.where(noise > LEAST_NOISE, noise, 0.0)


def resolved(tip_ns: np.ndarray, depth: np.ndarray, time_ns: np.ndarray) -> np.ndarray:
    """Return at which times the depth is known, shape (m,), bool: not near corners that positions leave out.

    A straight line through positions before and after a corner is off it by up to a quarter of how far the corner is
    off a straight line: of a fast ramp sampled seldom that is far more than any reading's noise. A path that is given
    by its corners, not sampled at a rate, is known everywhere.

    Args:
        tip_ns: Of each position [ns], shape (n,).
        depth: Positions [mm], shape (n,).
        time_ns: Times asked for [ns], shape (m,).
    """
    if len(tip_ns) < FEWEST_POSITIONS or not _sampled(tip_ns):
        return np.ones(len(time_ns), dtype=bool)
    step = np.maximum(np.diff(tip_ns) * 1e-9, 1e-12)
    speed = np.diff(depth) / step
    changes = np.abs(np.diff(speed)) * np.minimum(step[1:], step[:-1])
    corner = np.concatenate([[False], changes > CORNER * max(float(np.ptp(depth)), 1e-12), [False]])
    excluded = corner[1:] | corner[:-1]  # of each stretch between positions
    at = np.clip(np.searchsorted(tip_ns, time_ns, side="right") - 1, 0, len(excluded) - 1)
    return ~excluded[at]


def _sampled(time_ns: np.ndarray) -> bool:
    """Return whether positions were sampled at a rate, rather than given where a path has its corners."""
    step = np.diff(time_ns)
    return bool(np.quantile(step, REGULAR) <= 2 * np.median(step))


def _noise(time: np.ndarray, values: np.ndarray) -> float:
    """Return the noise of values by how far each is off the line between its neighbours; 0 if half are not off.

    By second differences of that: a path bends equally from one position to the next, its noise does not.
    """
    share = (time[1:-1] - time[:-2]) / np.maximum(time[2:] - time[:-2], 1e-12)
    deviation = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    fourth = deviation[:-2] - 2 * deviation[1:-1] + deviation[2:]
    # Of independent noise at equal steps these differences have 17.5 times the variance. The factor 1.4826 makes the
    # median absolute deviation of a normal variable its standard deviation.
    return float(1.4826 * np.median(np.abs(fourth)) / np.sqrt(17.5))


def _smoothed(time: np.ndarray, values: np.ndarray, noise: float) -> np.ndarray:
    """Return values by the widest windows that agree with all narrower ones, shape (n,)."""
    count = len(values)
    middle, mean = time.mean(), values.mean()
    t, y = time - middle, values - mean
    # A window's sums are differences of cumulative ones: a fit costs the same at any width. They are of centred values,
    # so that the differences keep their digits.
    sums = [np.concatenate([[0.0], np.cumsum(s)]) for s in (np.ones(count), t, y, t * t, t * y)]
    result = y.copy()
    low, high = y - AGREE_Z * noise, y + AGREE_Z * noise
    open_ = np.ones(count, dtype=bool)
    for width in WINDOWS:
        at = np.arange(count)
        reach = np.minimum(np.minimum(at, count - 1 - at), width)
        first, last = at - reach, at + reach + 1
        n, st, sy, stt, sty = (s[last] - s[first] for s in sums)
        spread = np.maximum(stt - st * st / n, 1e-12)
        slope = (sty - st * sy / n) / spread
        away = t - st / n
        line = sy / n + slope * away
        error = AGREE_Z * noise * np.sqrt(1 / n + away * away / spread)
        low, high = np.maximum(low, line - error), np.minimum(high, line + error)
        open_ &= (low <= high) & (reach == width)
        result[open_] = line[open_]
    return result + mean


def without_dropouts(time_ns: np.ndarray, tip: np.ndarray) -> tuple[np.ndarray, int]:
    """Return a path without positions that jump far away and back at once, and how many did.

    A controller that misses an answer writes a zero: each would cut a press in two.

    Args:
        time_ns: Of the positions, in their order, shape (n,).
        tip: The positions [mm], shape (n, 3).
    """
    step = np.diff(time_ns)
    if len(tip) < FEWEST_SAMPLED or np.mean(step <= 2 * np.median(step)) < REGULAR:
        return tip, 0
    cleaned = without_spikes(tip)
    far = np.abs(tip - cleaned) > DROPOUT * np.maximum(np.ptp(cleaned, axis=0), 1e-9)
    lost = far.any(axis=1)
    if not 0 < lost.mean() < MOST_LOST:
        return tip, 0
    return np.where(lost[:, None], cleaned, tip), int(lost.sum())
