"""Motion of the tip: noise of its recorded path, speeds of pressing and release, time at rest."""

from __future__ import annotations

from collections import deque

import numpy as np

from tacdata.chain import Course

HOLD = 0.95
"""Shortest hold that shows relaxation [s]: one of a second, of which readings may miss both ends."""
TOUCHING = 0.02
"""Depth, over the largest of all, from which on a way is one of pressing and not of the way there [1]."""
LEVELS = 40
"""Most levels of depth between which a speed is measured."""
CLEAR = 10.0
"""Levels lie so many times the path's noise apart at least [1]."""
STILL = 0.002
"""Band within which a tip rests, of the stroke [1]..."""
SWAY = 10.0
"""...and of the path's noise: that much more than a minute of readings takes up [1]."""
LINGERS = 4.0
"""A tip at rest stays in the band so many times as long as one that presses takes through it [1]."""
DEEP = 0.3
"""Hold: deeper than this share of the stroke [1]."""
STOP = 0.4
"""A stop of a staircase is no shorter [s]."""
STAIRS = 3
"""A staircase stops so often on its way in, and on its way out, below its top [1]."""


def speeds(course: Course) -> tuple[np.ndarray, np.ndarray]:
    """Return the press and release speeds of each episode with contact.

    A speed is the median over levels of depth of the way between two over the time that it takes: neither noise of the
    path, nor a stop at a few depths, nor how the tip comes to the skin changes it.

    Returns:
        While pressing and while letting go [mm/s], each of shape (episodes that touch,); NaN where it is not seen.
    """
    spacing = max(course.span / LEVELS, CLEAR * course.dither)
    loading, unloading = [], []
    for e in range(course.episodes):
        rows = np.flatnonzero(course.episode == e)
        depth, time = course.tip[rows, 2], course.time[rows]
        if not len(rows) or depth.max() <= TOUCHING * course.span:
            continue
        top = int(np.argmax(depth))
        loading.append(_speed(time[: top + 1], depth[: top + 1], TOUCHING * course.span, spacing))
        # Backwards in time the way out is a way in.
        unloading.append(_speed(-time[top:][::-1], depth[top:][::-1], TOUCHING * course.span, spacing))
    return np.array(loading), np.array(unloading)


def _speed(time: np.ndarray, depth: np.ndarray, low: float, spacing: float) -> float:
    """Return the speed at which a path first reaches levels of depth [mm/s]; NaN where it has none to reach."""
    reached = np.maximum.accumulate(depth)
    new = np.append(True, np.diff(reached) > 0)
    low = max(low, float(depth[0]))
    count = min(LEVELS, int((reached[-1] - low) / spacing))
    if count < 1:
        return np.nan
    levels = np.linspace(low, float(reached[-1]), count + 1)
    # A level is reached on the way from the row before, which may be long after the last new depth: not during a stop.
    at = np.flatnonzero(new)
    lower = np.maximum(at - 1, 0)
    known_time = np.column_stack([time[lower], time[at]]).ravel()
    known_depth = np.column_stack([reached[lower], reached[at]]).ravel()
    passed = np.interp(levels, known_depth, known_time)
    took = np.diff(passed)
    took = took[took > 0]
    return float((levels[1] - levels[0]) / np.median(took)) if len(took) else np.nan


def pressing_time(course: Course) -> float:
    """Return how long a press takes from contact to its top, as the median [s]; 0 where none touches."""
    loading, _ = speeds(course)
    deepest = [float(course.tip[course.episode == e, 2].max()) for e in range(course.episodes)]
    ways = np.array([way for way in deepest if way > TOUCHING * course.span])
    took = ways / loading
    return float(np.nanmedian(took)) if np.isfinite(took).any() else 0.0


def longest_hold(course: Course) -> float:
    """Return the longest time that the tip rests at depth [s].

    It rests while its depth stays within a band: a small share of the stroke, and room for the noise of the path.
    """
    depth = course.tip[:, 2]
    band = STILL * course.stroke + SWAY * course.dither
    deep = depth > depth.min() + DEEP * course.stroke
    longest = 0.0
    for rows in np.split(np.arange(course.rows), np.flatnonzero(course.first | ~deep)):
        rows = rows[deep[rows]]
        if len(rows) > 1 and course.time[rows[-1]] - course.time[rows[0]] > longest:
            longest = max(longest, _within(course.time[rows], depth[rows], band))
    pressed = np.concatenate(speeds(course))
    usual = float(np.nanmedian(pressed)) if np.isfinite(pressed).any() else 0.0
    return longest if usual <= 0 or longest > LINGERS * band / usual else 0.0


def stairs(course: Course) -> bool:
    """Return whether most presses stop at several depths on the way in, and on the way out.

    Lag vanishes at a stop; friction and play do not.
    """
    band = STILL * course.stroke + SWAY * course.dither
    count, pressed = 0, 0
    for e in range(course.episodes):
        rows = np.flatnonzero(course.episode == e)
        time, depth = course.time[rows], course.tip[rows, 2]
        if not len(rows) or depth.max() <= TOUCHING * course.span:
            continue
        between = (depth > DEEP / 3 * course.span) & (depth < depth.max() - 2 * band)
        top = int(np.argmax(depth))
        ways = between & (np.arange(len(rows)) < top), between & (np.arange(len(rows)) > top)
        pressed += 1
        count += all(_stops(time[way], depth[way], band) >= STAIRS for way in ways)
    return 2 * count > pressed


def _stops(time: np.ndarray, depth: np.ndarray, band: float) -> int:
    """Return how often a depth stays within a band for as long as a stop."""
    number, begin = 0, 0
    while begin < len(depth):
        outside = np.flatnonzero(np.abs(depth[begin:] - depth[begin]) > band)
        end = begin + int(outside[0]) if len(outside) else len(depth)
        stops = time[end - 1] - time[begin] >= STOP
        number += bool(stops)
        begin = end if stops else begin + 1
    return number


def _within(time: np.ndarray, depth: np.ndarray, band: float) -> float:
    """Return the longest time over which a depth stays within a band [s]."""
    high: deque[int] = deque()
    low: deque[int] = deque()
    begin, longest = 0, 0.0
    value = depth.tolist()
    for i, d in enumerate(value):
        while high and value[high[-1]] <= d:
            high.pop()
        while low and value[low[-1]] >= d:
            low.pop()
        high.append(i)
        low.append(i)
        while value[high[0]] - value[low[0]] > band:
            begin += 1
            if high[0] < begin:
                high.popleft()
            if low[0] < begin:
                low.popleft()
        longest = max(longest, float(time[i] - time[begin]))
    return longest
