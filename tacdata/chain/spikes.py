"""Single readings that cannot be: jumps there and back, and frames that repeat the one before."""

from __future__ import annotations

import numpy as np

FAR = 8.0
"""Least size of a jump, in standard deviations of the readings from the median of their neighbours [1]..."""
WIDE = 2.0
"""...and so many times the range of the four neighbours, so that the tip of a stroke is none [1]."""
SELDOM = 0.1
"""Frames that repeat are copies only if no larger a share does: coarse readings repeat by themselves [1]."""
ENOUGH = 3
"""Fewer channels repeat by themselves."""


def without_spikes(values: np.ndarray) -> np.ndarray:
    """Return readings with single jumps replaced by the median of their neighbours.

    Args:
        values: One stream a column, in the order of time, shape (n, k); NaN where missing.
    """
    if len(values) < 7:
        return values
    near = np.stack([np.roll(values, shift, axis=0) for shift in (-2, -1, 1, 2)])
    middle = np.median(near, axis=0)
    deviation = np.abs(values - middle)
    inner = deviation[2:-2]
    finite = np.isfinite(inner)
    count = np.maximum(finite.sum(axis=0), 1)
    # A mean that single jumps do not move much; a median is 0 where readings are mostly the same.
    bounded = np.where(finite, np.minimum(inner, np.where(finite, inner, 0.0).sum(axis=0) / count * 4), 0.0)
    # sqrt(pi / 2) times the mean absolute deviation is a Gaussian's standard deviation.
    usual = 1.2533 * bounded.sum(axis=0) / count
    jump = (deviation > FAR * usual) & (deviation > WIDE * (near.max(axis=0) - near.min(axis=0)))
    # `roll` wraps around: the outermost rows have neighbours from the other end.
    jump[:2] = jump[-2:] = False
    return np.where(jump, middle, values)


def copies(values: np.ndarray) -> np.ndarray:
    """Return which frames are copies of the one before, shape (n,), bool: equal in all channels, and rare.

    Args:
        values: One channel a column, shape (n, k).
    """
    same = np.zeros(len(values), dtype=bool)
    if values.shape[1] >= ENOUGH and len(values) > 1:
        same[1:] = np.all(values[1:] == values[:-1], axis=1)
    return same if 0 < same.mean() < SELDOM else np.zeros(len(values), dtype=bool)
