"""Derives a press from the path of an indenter: depth, speed and phases."""

from dataclasses import dataclass

import numpy as np

from tacdata.recording.episode import Phase

STILL = 0.005
"""Share of the stroke within which the indenter counts as being at full depth [1]."""
ROUNDED = 1.6
"""Largest ratio of the time within four times that share to the time within it, for a hold [1]. At a mere turning point
the ratio is two.
"""
LOW = 0.02
"""Share of the stroke, from its highest point, at which loading begins [1]."""
SHORTEST_HOLD = 0.2
"""A rest at full depth shorter than this is not a hold [s]."""


@dataclass(frozen=True)
class PressPath:
    """A press as derived from its path."""

    depth: float
    """Largest depth [mm]."""
    speed: float | None
    """Median speed while loading [mm/s]; None if it does not move."""
    hold: float
    """Time at full depth [s]."""
    x: float
    """Place at full depth [mm]."""
    y: float
    """Place at full depth [mm]."""
    phases: tuple[Phase, ...]
    """Rest, press, hold and release, where there is one press; none for several strokes."""


def press_path(time_ns: np.ndarray, tip: np.ndarray) -> PressPath:
    """Derive a press from its path.

    Args:
        time_ns: Times [ns], shape (n,), increasing.
        tip: x, y and depth in the sensor's frame [mm], shape (n, 3).
    """
    depth = tip[:, 2]
    peak = int(np.argmax(depth))
    deepest, stroke = float(depth[peak]), float(np.ptp(depth))
    x, y = (float(np.median(tip[depth >= deepest - STILL * stroke, k])) for k in (0, 1))
    if stroke <= 0:
        return PressPath(deepest, None, 0.0, x, y, ())
    first, last = _run(depth >= deepest - STILL * stroke, peak)
    contact = max(0.0, float(depth.min())) if deepest > 0 else float(depth.min())
    low = contact + LOW * stroke
    begin = int(np.flatnonzero(depth[: first + 1] <= low)[-1]) if (depth[: first + 1] <= low).any() else 0
    returns = np.flatnonzero(depth[last:] <= low)
    end = last + int(returns[0]) if len(returns) else len(depth) - 1
    loading = slice(begin, first + 1)
    seconds = np.diff(time_ns[loading]) / 1e9
    moving = seconds > 0
    rates = np.diff(depth[loading])[moving] / seconds[moving]
    speed = float(np.median(rates[rates > 0])) if (rates > 0).any() else None
    hold = float(time_ns[last] - time_ns[first]) / 1e9
    # At the turning point of a parabola the time near the top grows with the root of the distance: fourfold gives two.
    near = _run(depth >= deepest - 4 * STILL * stroke, peak)
    if hold < SHORTEST_HOLD or (time_ns[near[1]] - time_ns[near[0]]) / 1e9 > ROUNDED * hold:
        hold = 0.0
    phases = () if strokes(depth, low) > 1 else _phases(time_ns, begin, first, last, end, hold)
    return PressPath(deepest, speed, hold, x, y, phases)


def _run(mask: np.ndarray, at: int) -> tuple[int, int]:
    """Return the first and last index of the run of True around an index."""
    outside = np.flatnonzero(~mask)
    earlier, later = outside[outside < at], outside[outside > at]
    return (int(earlier[-1]) + 1 if len(earlier) else 0), (int(later[0]) - 1 if len(later) else len(mask) - 1)


def strokes(depth: np.ndarray, low: float) -> int:
    """Count the strokes: how often the path goes from the bottom tenth into the top half of its range."""
    high = low + 0.5 * (float(depth.max()) - low)
    state, count = False, 0
    for above, below in zip(depth > high, depth <= low, strict=True):
        if above and not state:
            state, count = True, count + 1
        elif below:
            state = False
    return count


def _phases(time_ns: np.ndarray, begin: int, first: int, last: int, end: int, hold: float) -> tuple[Phase, ...]:
    marks: list[tuple[str, int, int]] = []
    if begin > 0:
        marks.append(("rest", int(time_ns[0]), int(time_ns[begin])))
    top = (first + last) // 2
    rising, falling = (first, last) if hold else (top, top)
    marks.append(("press", int(time_ns[begin]), int(time_ns[rising])))
    if hold:
        marks.append(("hold", int(time_ns[first]), int(time_ns[last])))
    marks.append(("release", int(time_ns[falling]), int(time_ns[end])))
    return tuple(Phase(*mark) for mark in marks if mark[2] > mark[1])
