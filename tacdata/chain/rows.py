"""Rows of a course from a stream and a path: dense where the tip moves, averaged where it rests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.chain.spikes import copies, without_spikes

BETWEEN = 0.03
"""Longest way between rows [mm, and of the deepest point, whichever is more]: readings of a fast press lie farther
apart than effects of timing can bear."""
FEW_BETWEEN = 4
"""Most rows put between two readings, and as many where the speed changes."""
KINK = 0.15
"""Change of speed from one reading to the next, of the largest speed, that is sudden [1]."""
SHORT = 0.4
"""A sudden change of speed over less of the longest way does not matter [1]."""
BENT = 0.1
"""A path may be off straight lines by this share of the longest way [1]..."""
NOISE, MIDDLE = 4.0, 1.4826
"""...and by its noise: standard deviations; one, over the median [1]."""
SETTLED = 0.4
"""Time after the last motion from which readings are averaged [s]."""
MANY = 300
"""Readings in motion of one episode from which on those of slow motion are averaged too [1]..."""
SLOW = 0.01
"""...over no more than this way [mm, and of the deepest point, whichever is more]..."""
BRIEF = 0.032
"""...and no longer than this [s]."""
WIDEST = 0.12
"""Share of the time at rest that an average may span [1]."""


@dataclass(frozen=True)
class Rows:
    """One episode's rows."""

    time: np.ndarray
    """[s], shape (n,)."""
    tip: np.ndarray
    """x, y, depth [mm], shape (n, 3)."""
    values: np.ndarray
    """Streams [their own units], shape (n, k); NaN in rows in between."""
    averaged: np.ndarray
    """Readings behind each row [1], shape (n,); 0 in between."""


def rows_of(
    time: np.ndarray, values: np.ndarray, path_time: np.ndarray, path: np.ndarray, channels: int | None = None
) -> Rows:
    """Lay out the rows of one episode.

    Args:
        time: Times of the readings [s], shape (m,), increasing.
        values: Readings and whatever else belongs to those times, shape (m, k).
        path_time: Times of the commanded path [s], shape (p,), increasing.
        path: x, y, depth [mm], shape (p, 3), linear in between.
        channels: How many of the first columns are the sensor's, None for all: a frame that repeats them is a copy.
    """
    new = ~copies(values[:, :channels])
    time, values = time[new], without_spikes(values[new])

    def tip_at(when: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(when, path_time, path[:, axis]) for axis in range(3)], axis=-1)

    tip = tip_at(time)
    moving = np.abs(np.diff(tip, axis=0, prepend=tip[:1])).max(axis=1) > 1e-5
    # An episode that begins at rest has rested long enough.
    last = np.maximum.accumulate(np.where(moving, time, time[0] - SETTLED if not moving[0] else time[0]))
    slow = SLOW * max(1.0, float(path[:, 2].max())) if moving.sum() > MANY else -1.0
    group = _groups(time, last, tip, slow)
    count = np.bincount(group).astype(float)
    mean_time = np.bincount(group, time) / count
    mean = np.stack([_mean(group, column) for column in values.T], axis=-1)
    longest = BETWEEN * max(1.0, float(path[:, 2].max()))
    between = _between(mean_time, tip_at(mean_time), longest) if len(mean_time) > 1 else np.zeros(0)
    between = np.union1d(between, _corners(np.union1d(mean_time, between), path_time, path, BENT * longest))
    times = np.concatenate([mean_time, between])
    order = np.argsort(times, kind="stable")
    filled = np.concatenate([mean, np.full((len(between), values.shape[1]), np.nan)])[order]
    weight = np.concatenate([count, np.zeros(len(between))])[order]
    # The mean of readings is that at their mean tip: where the tip turns, it was elsewhere at their mean time.
    way = np.stack([_mean(group, column) for column in tip.T], axis=-1)
    return Rows(times[order], np.concatenate([way, tip_at(between)])[order], filled, weight)


def _mean(group: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the mean of the finite values of each group; NaN without any."""
    finite = np.isfinite(column)
    if finite.all():
        return np.bincount(group, column) / np.bincount(group)
    count = np.bincount(group, finite)
    total = np.bincount(group, np.where(finite, column, 0.0))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _groups(time: np.ndarray, last: np.ndarray, tip: np.ndarray, slow: float) -> np.ndarray:
    """Number the groups of readings that become one row.

    Args:
        time: Of each reading [s], shape (n,).
        last: Time of the last motion before each [s], shape (n,).
        tip: [mm], shape (n, 3).
        slow: Longest way within a group that moves [mm]; below 0 each reading that moves is a row.
    """
    result, number, begin = np.zeros(len(time), dtype=np.int64), 0, 0
    for i in range(1, len(time)):
        pause = time[begin] - last[begin]
        wide = max(pause, 0.0) * WIDEST
        resting = pause >= SETTLED and last[i] == last[begin] and time[i] - time[begin] <= wide
        if not resting:
            near = slow >= 0 and time[i] - time[begin] <= BRIEF and np.abs(tip[i] - tip[begin]).max() <= slow
            if not near:
                number, begin = number + 1, i
        result[i] = number
    return result


def _corners(time: np.ndarray, path_time: np.ndarray, path: np.ndarray, tolerance: float) -> np.ndarray:
    """Return times at which the path is off the straight lines between rows.

    A corner that is cut looks like a delay or a filter.

    Args:
        time: Times of the rows [s], shape (n,), increasing.
        path_time: Times of the path [s], shape (p,).
        path: x, y, depth [mm], shape (p, 3).
        tolerance: How far off a straight line may be [mm].
    """
    bent = np.diff(path, 2, axis=0)
    # Fewer points than readings are the corners of a command.
    measured = len(path) > len(time)
    # A second difference of white noise has six times its variance: 1 + 4 + 1.
    noise = MIDDLE * np.median(np.abs(bent), axis=0) / np.sqrt(6) if measured and len(bent) else np.zeros(3)
    within = (path_time > time[0]) & (path_time < time[-1])
    when, corners = path_time[within], path[within]
    rows = time
    for _ in range(FEW_BETWEEN):
        straight = np.stack([np.interp(rows, path_time, path[:, axis]) for axis in range(3)], axis=-1)
        deviation = np.stack([np.interp(when, rows, straight[:, axis]) for axis in range(3)], axis=-1) - corners
        deviation = (np.abs(deviation) - NOISE * noise).max(axis=1, initial=-np.inf)
        # One row per gap and pass, at the farthest corner: the next pass sees the path with it.
        gap = np.searchsorted(time, when)
        order = np.lexsort((-deviation, gap))
        first = order[np.flatnonzero(np.diff(gap[order], prepend=-1))]
        added = when[first[deviation[first] > tolerance]]
        if not len(added):
            break
        rows = np.union1d(rows, added)
    return np.setdiff1d(rows, time)


def _between(time: np.ndarray, tip: np.ndarray, longest: float) -> np.ndarray:
    """Return times of rows put between readings where the tip moves fast or changes its speed."""
    gap = np.maximum(np.diff(time), 1e-9)
    way = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    speed = way / gap
    change = np.abs(np.diff(speed, prepend=speed[:1], append=speed[-1:])) > KINK * max(
        float(speed.max(initial=0)), 1e-9
    )
    kink = change[:-1] | change[1:]
    counts = np.where(kink & (gap < 0.2) & (way > SHORT * longest), FEW_BETWEEN, np.ceil(way / longest) - 1)
    parts = []
    for i in np.flatnonzero(counts > 0):
        count = int(min(counts[i], FEW_BETWEEN))
        parts.append(time[i] + gap[i] * np.arange(1, count + 1) / (count + 1))
    return np.concatenate(parts) if parts else np.zeros(0)
