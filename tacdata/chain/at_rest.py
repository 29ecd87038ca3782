"""Readings without contact, and the gains that follow from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.chain.course import Course

UNLIKE = 0.5
"""Least spread of readings, over their mean, that distinguishes a gain from drifting offsets [1]."""
BELOW, CLEARLY, ANSWERED, FEWEST = 0.5, 0.2, 0.3, 10
"""A path has no side without contact if it goes so far below zero, over its depth. Readings have to span so much of
their range clearly below, that is, by such a share of the way, in so many rows."""
AT_REST = 0.05
"""Least reading without contact that distinguishes it from a gain above idle [largest rise]."""


def quiet_rows(course: Course) -> np.ndarray:
    """Return rows where nothing presses, shape (n,), bool."""
    return course.tip[:, 2] <= max(0.0, float(course.tip[:, 2].min()) + 0.05 * course.stroke)


def told_at_rest(course: Course) -> tuple[np.ndarray | None, str]:
    """Return each channel's reading without contact, shape (channels,), or None and why it gives no gain.

    Args:
        course: The recordings; those with the rows read alone will do.
    """
    course = course.reduced if len(course.read) < course.rows else course
    finite = np.isfinite(course.readings).all(axis=1)
    quiet = finite & quiet_rows(course)
    if not quiet.any():
        return None, "nothing was read without contact"
    values, idle = course.readings[finite], np.median(course.readings[quiet], axis=0)
    if np.abs(idle).max() < AT_REST * np.abs(values - idle).max():
        return None, "readings without contact are about zero"
    if np.std(values) < UNLIKE * abs(float(np.mean(values))):
        return None, "all readings are about alike: offsets that drift look the same"
    return idle, ""


@dataclass(frozen=True)
class ZeroSide:
    """Extent of a path below zero, and change of the readings there."""

    low: float
    """Way below zero [mm]; 0 if it is too short for an answer."""
    under: np.ndarray
    """Range of each channel clearly below zero [its unit], shape (channels,)."""
    over: np.ndarray
    """Range of each channel clearly above zero, over that side's share of the way [its unit], shape (channels,)."""
    whole: np.ndarray
    """Range of each channel along the path [its unit], shape (channels,)."""

    def answered(self, ranges: np.ndarray) -> tuple[bool, bool]:
        """Return whether readings answer below and above zero as they do in the range ``ranges``."""
        # One channel alone may be one that nothing presses.
        least = ANSWERED * max(float(np.linalg.norm(ranges)), 1e-300)
        return bool(np.linalg.norm(self.under) >= least), bool(np.linalg.norm(self.over) >= least)


def zero_side(depth: np.ndarray, readings: np.ndarray) -> ZeroSide:
    """Return the part of a path on each side of zero.

    Args:
        depth: Along the path [mm], shape (n,).
        readings: At the same times [any unit], shape (n, channels).
    """
    finite = np.isfinite(depth) & np.isfinite(readings).any(axis=1)
    depth, readings = depth[finite], readings[finite]
    ranges = _range(readings)
    low, high = -float(depth.min(initial=0.0)), float(depth.max(initial=0.0))
    below = depth < -CLEARLY * low
    is_way = low >= BELOW * high and below.sum() >= FEWEST
    under = _range(readings[below]) if is_way else np.zeros_like(ranges)
    over = _range(readings[depth > CLEARLY * high]) * (1 + low / high if high else 1.0)
    return ZeroSide(low if is_way and high else 0.0, under, over, ranges)


def below_zero(sides: Sequence[ZeroSide]) -> float:
    """Return how far paths go below zero [mm] if readings answer there as above, in half of the paths or more, else 0.

    A damper's piston has no side on which nothing is touched. One press that misses the skin is no such piston.
    """
    if not sides:
        return 0.0
    ranges = np.max([side.whole for side in sides], axis=0)
    each = [side.low * all(side.answered(ranges)) for side in sides]
    return max(each) if np.count_nonzero(each) >= 0.5 * len(each) else 0.0


def turned(sides: Sequence[ZeroSide]) -> list[int]:
    """Return the numbers of the paths along which readings answer below zero alone: their sign is another."""
    ranges = np.max([side.whole for side in sides], axis=0) if sides else np.zeros(0)
    return [number for number, side in enumerate(sides) if side.answered(ranges) == (True, False)]


def always_touched(course: Course) -> float:
    """Return how far below zero [mm] readings answer as they do above, in half of the episodes or more, else 0."""
    course = course.reduced if len(course.read) < course.rows else course
    edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
    spans = [slice(a, b) for a, b in pairwise(edges) if np.isfinite(course.readings[a:b]).any()]
    return below_zero([zero_side(course.tip[rows, 2], course.readings[rows]) for rows in spans])


def _range(readings: np.ndarray) -> np.ndarray:
    """Return the range of each channel without its outermost tenth and without noise, shape (channels,).

    Noise is the median difference of successive readings; normal noise spans 3.3 standard deviations.
    """
    result = np.zeros(readings.shape[1])
    for channel, column in enumerate(readings.T):
        finite = column[np.isfinite(column)]
        if len(finite) > 1:
            noise = 3.3 * 1.4826 * float(np.median(np.abs(np.diff(finite)))) / np.sqrt(2)
            result[channel] = np.sqrt(max(float(np.ptp(np.quantile(finite, [0.05, 0.95]))) ** 2 - noise**2, 0.0))
    return result
