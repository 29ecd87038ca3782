"""Whether readings and path were recorded on one clock."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course

LEAST_SHIFT = 0.25
"""A smaller shift is a sensor's delay, no error of clocks [s]."""
WIDEST, LAGS = 5.0, 101
"""Largest delay that is tried [s], and how many."""
CLEARER = 0.3
"""Largest share of the unexplained variance that may be left at the best delay [1]."""


def shifted(course: Course) -> list[str]:
    """Return in words whether the readings follow the path at another time: their clocks were not one."""
    reduced = course.reduced
    size = np.nan_to_num(reduced.readings - np.nanmedian(reduced.readings, axis=0))
    main = size @ np.linalg.svd(size[:: max(len(size) // 4000, 1)], full_matrices=False)[2][0]
    lags = np.linspace(-WIDEST, WIDEST, LAGS)
    left = np.array([_left_at(course, main, lag) for lag in lags])
    best, none = int(np.argmin(left)), float(left[LAGS // 2])
    if abs(lags[best]) <= LEAST_SHIFT or left[best] > CLEARER * none:
        return []
    return [
        f"readings follow the path about {abs(lags[best]):.1f} s {'later' if lags[best] > 0 else 'earlier'} than their "
        f"times say ({100 * left[best]:.0f} % of their change is left then, {100 * none:.0f} % as they are): were the "
        "clocks one? Record both on one clock, or give the offset of one in the import's mapping"
    ]


def _left_at(course: Course, reading: np.ndarray, lag: float) -> float:
    """Return the share of a reading's variance that depth does not explain at a delay, an offset an episode allowed."""
    reduced, left, whole = course.reduced, 0.0, 0.0
    for e in np.unique(reduced.episode):
        rows, path = reduced.episode == e, course.episode == e
        depth = np.interp(reduced.time[rows] - lag, course.time[path], np.maximum(course.tip[path, 2], 0.0))
        own = reading[rows] - reading[rows].mean()
        depth = depth - depth.mean()
        own_power, power = float(own @ own), float(depth @ depth)
        whole += own_power
        left += own_power - (float(own @ depth) ** 2 / power if power > 0 else 0.0)
    return left / max(whole, 1e-30)
