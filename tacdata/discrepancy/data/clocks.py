"""Whether readings and path were recorded on one clock, and how late readings are on either way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from tacdata.chain import Course
from tacdata.chain.memory import low_pass

LEAST_SHIFT = 0.25
"""A smaller shift is a sensor's delay, no error of clocks [s]."""
WIDEST, LAGS = 5.0, 101
"""Largest delay that is tried [s], and how many."""
SCANS = ((0.5, 0.05), (0.5, 0.05), (0.06, 0.01), (0.06, 0.01))
"""Edges: reach and step of each scan for the onset's and the recovery's delay, in turn [s]."""
TOP = 0.9
"""Edges: a press turns in the middle of the time for which it is deeper than this share of its depth [1]."""
KNOTS = 10
"""Edges: intervals of the splines of readings over depth."""
CREEPS = (1.0, 8.0)
"""Edges: time constants of a skin that creeps or relaxes meanwhile: without them its recovery looks late [s]."""
MOST_ROWS = 6000
"""Edges: most rows that are used."""
CLEARER = 0.3
"""Largest share of the unexplained variance that may be left at the best delay [1]."""


def shifted(course: Course) -> tuple[bool, tuple[str, ...]]:
    """Return whether readings follow the path late, and in words by how much they are late or early."""
    lag, share, none = shift(course)
    if abs(lag) <= LEAST_SHIFT or share > CLEARER * none:
        return lag > 0, ()
    return lag > 0, (
        f"readings follow the path about {abs(lag):.1f} s {'later' if lag > 0 else 'earlier'} than their "
        f"times say ({100 * share:.0f} % of their change is left then, {100 * none:.0f} % as they are): were the "
        "clocks one? Record both on one clock, or give the offset of one in the import's mapping",
    )


def shift(course: Course) -> tuple[float, float, float]:
    """Return by how much readings follow the path later than their times say [s].

    With it the shares of their variance that depth does not explain then, and as they are [1].
    """
    lags, presses = np.linspace(-WIDEST, WIDEST, LAGS), list(_presses(course))
    unexplained = np.array([sum(_unexplained(press, lag) for press in presses) for lag in lags])
    shares = unexplained / max(sum(float(press.reading @ press.reading) for press in presses), 1e-30)
    best = int(np.argmin(shares))
    return float(lags[best]), float(shares[best]), float(shares[LAGS // 2])


@dataclass(frozen=True)
class _Press:
    """One press: a reading without its mean, shape (m,), and the tip's depth, shape (n,), each with its times [s]."""

    reading: np.ndarray
    reading_time: np.ndarray
    depth: np.ndarray
    time: np.ndarray


def _presses(course: Course) -> Iterator[_Press]:
    reduced, main = course.reduced, _main(course)
    for e in np.unique(reduced.episode):
        rows, path = reduced.episode == e, course.episode == e
        reading = main[rows]
        yield _Press(
            reading - reading.mean(), reduced.time[rows], np.maximum(course.tip[path, 2], 0.0), course.time[path]
        )


def _unexplained(press: _Press, lag: float) -> float:
    """Return the sum of squares of a reading that depth does not explain at a delay [s], but for an offset."""
    depth = np.interp(press.reading_time - lag, press.time, press.depth)
    depth = depth - depth.mean()
    power = float(depth @ depth)
    total = float(press.reading @ press.reading)
    return total - (float(press.reading @ depth) ** 2 / power if power > 0 else 0.0)


def edges(course: Course, about: float) -> tuple[float, float]:
    """Return by how much readings are late while the tip presses, and while it leaves [s].

    On both ways a reading is the same smooth function of the depth so long before, plus slow memory. The two delays
    are those that such splines follow best.

    Args:
        course: The recordings.
        about: By how much readings are late on the whole [s].
    """
    reduced, lags = course.reduced, [about, about]
    rows = np.arange(0, len(reduced.time), max(len(reduced.time) // MOST_ROWS, 1))
    leaves = np.concatenate([time > turn + about for _, turn, time in _turns(course)])[rows]
    main, episode = _main(course)[rows], reduced.episode[rows]
    offsets = (episode[:, None] == np.unique(episode)).astype(float)
    place = course.row_site[course.read][rows]

    gap = np.diff(reduced.time[rows], prepend=reduced.time[rows][:1])

    def left(times: list[float]) -> float:
        depth = _depth_before(course, np.where(leaves, times[1], times[0]), rows)
        inner = np.linspace(0.0, max(float(depth.max()), 1e-9), KNOTS + 1)
        design = BSpline.design_matrix(depth, np.r_[[inner[0]] * 3, inner, [inner[-1]] * 3], 3).toarray()
        slow = np.stack([low_pass(depth, gap, tau) for tau in CREEPS], axis=1)
        design = np.concatenate([design, slow], axis=1)
        each = [design * (place == p)[:, None] for p in np.unique(place)]
        columns = np.concatenate([*each, offsets], axis=1)
        return float(np.square(main - columns @ np.linalg.lstsq(columns, main, rcond=1e-9)[0]).sum())

    for reach, step in SCANS:
        for way in (0, 1):
            tried = lags[way] + np.arange(-reach, reach + step / 2, step)
            shares = [left([t, lags[1]] if way == 0 else [lags[0], t]) for t in tried]
            lags[way] = float(tried[int(np.argmin(shares))])
    return lags[0], lags[1]


def _main(course: Course) -> np.ndarray:
    """Return the first principal component of all channels, shape (m,)."""
    readings = course.reduced.readings
    size = np.nan_to_num(readings - np.nanmedian(readings, axis=0))
    return size @ np.linalg.svd(size[:: max(len(size) // 4000, 1)], full_matrices=False)[2][0]


def _turns(course: Course) -> Iterator[tuple[int, float, np.ndarray]]:
    """Give each episode that was read, when its tip turns [s], and the times of its readings."""
    for e in np.unique(course.reduced.episode):
        path = course.episode == e
        depth, time = course.tip[path, 2], course.time[path]
        deep = time[depth >= TOP * depth.max()]
        yield int(e), float(0.5 * (deep[0] + deep[-1])), course.reduced.time[course.reduced.episode == e]


def _depth_before(course: Course, lags: np.ndarray, selection: np.ndarray) -> np.ndarray:
    """Return the depth so long before each reading, never below 0, shape as ``lags``."""
    reduced, result = course.reduced, np.empty(len(selection))
    for e in np.unique(reduced.episode[selection]):
        rows, path = reduced.episode[selection] == e, course.episode == e
        times = reduced.time[selection][rows] - lags[rows]
        result[rows] = np.interp(times, course.time[path], np.maximum(course.tip[path, 2], 0.0))
    return result
