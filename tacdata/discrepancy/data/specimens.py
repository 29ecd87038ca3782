"""Specimens that were pressed at one place one after the other, distinguished by their stiffness.

Test machines press many materials at the same place. One curve for all of them would make each material's stiffness
look like a gain that drifts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain.rows import Rows

APART, FAR_APART = 0.12, 0.4
"""Specimens differ by this much at least in the reading at one depth [natural logarithm]; two of them, and a few that
only get softer, by more: one specimen that changed does so, too."""
SURELY = 4
"""So many specimens, even if each is softer than the one before [1]."""
OVER_SCATTER = 1.5
"""...and by so many times the widest spread within one; by that spread, if they are many [1]."""
FEWEST_EACH = 3
"""Presses of a specimen, at least."""
REACH = 0.7
"""They are compared at this share of the median depth [1]."""
TOUCHED = 0.02
"""Readings before this share of a press's depth are those without load [1]."""
SAME_RATE = 0.25
"""Presses are of one rate that differ by less [natural logarithm]."""


def specimens(parts: Sequence[Rows], place: np.ndarray, channels: int) -> tuple[np.ndarray, list[str]]:
    """Return a number for each press that presses of one place and one specimen share, and a remark on it.

    Two groups that follow one another may be one specimen that changed: they are asked about, and not distinguished.

    Args:
        parts: Rows of each press.
        place: Number of its place (and tool), shape (presses,).
        channels: Number of channels among the rows' values.
    """
    result, words = place.copy(), []
    for where in np.unique(place):
        index = np.flatnonzero(place == where)
        group = _groups([parts[k] for k in index], channels)
        count = int(group.max()) + 1
        if count < 2:
            continue
        turns = int(np.count_nonzero(np.diff(group))) + 1
        if count == 2 and turns == 2:
            words.append(
                f"{len(index)} presses of one place read as if of two specimens, one after the other: if they are two, "
                "say which each press is of (`press: {specimen: ...}` in the import's mapping)"
            )
            continue
        result[index[group > 0]] = result.max() + group[group > 0]
        sizes = ", ".join(str(int(n)) for n in np.bincount(group))
        words.append(
            f"presses of one place fall into {count} specimens by what they read at one depth ({sizes} presses): each "
            "has a curve of its own; if it is one specimen, something else was touched or moved"
        )
    return result, words


def _groups(parts: Sequence[Rows], channels: int) -> np.ndarray:
    """Return the group of each press, by stiffness, shape (presses,); all 0 where there is one."""
    none = np.zeros(len(parts), dtype=np.int64)
    deepest = np.array([float(p.tip[:, 2].max()) for p in parts])
    if len(parts) < 2 * FEWEST_EACH or np.median(deepest) <= 0:
        return none
    at = REACH * float(np.median(deepest))
    deep = np.flatnonzero(deepest >= at)
    level = np.array([_level(parts[k], at, channels) for k in deep])
    deep, level = deep[level > 0], np.log(level[level > 0])
    number = _apart(level)
    if number.max(initial=0) == 0 or not _beside_rates(number, np.array([_rise(parts[k], at) for k in deep])):
        return none
    group = none.copy()
    group[deep] = number
    for k in np.setdiff1d(np.arange(len(parts)), deep):
        # Too shallow for the common depth: it is compared at its own.
        level_depth = 0.9 * float(deepest[k])
        stiffness = np.log(max(_level(parts[k], level_depth, channels), 1e-12))
        near = [
            abs(
                stiffness
                - np.mean([np.log(max(_level(parts[i], level_depth, channels), 1e-12)) for i in deep[number == n]])
            )
            for n in range(int(number.max()) + 1)
        ]
        group[k] = int(np.argmin(near))
    first = [int(np.flatnonzero(group == n)[0]) for n in range(int(group.max()) + 1)]
    # Numbered in the order of their first press: the group of the first one keeps the number of the place.
    return np.argsort(np.argsort(first))[group]


def _apart(level: np.ndarray) -> np.ndarray:
    """Return the group of each level, by size, shape (k,), int64; all 0 where they are not clearly apart."""
    none, order = np.zeros(len(level), dtype=np.int64), np.argsort(level)
    cuts = np.flatnonzero(np.diff(level[order]) >= APART)
    sizes = np.diff([0, *(cuts + 1), len(order)])
    if not len(cuts) or sizes.min() < FEWEST_EACH:
        return none
    number = none.copy()
    number[order] = np.repeat(np.arange(len(sizes)), sizes)
    within = max(float(np.ptp(level[number == k])) for k in range(len(sizes)))
    # Softer from press to press may also be one specimen that wears.
    softer = bool(np.all(np.diff(number) <= 0))
    threshold = FAR_APART if len(sizes) == 2 or (softer and len(sizes) < SURELY) else APART
    required = within * (1.0 if len(sizes) >= SURELY else OVER_SCATTER)
    return number if float(np.diff(level[order])[cuts].min()) >= max(required, threshold) else none


def _beside_rates(number: np.ndarray, rise: np.ndarray) -> bool:
    """Return whether groups are no rates of pressing: most rates have presses of several groups.

    Args:
        number: Group of each press, shape (k,).
        rise: Natural logarithm of the time that each takes to get down [s], shape (k,).
    """
    order = np.argsort(rise)
    rate = np.empty(len(rise), dtype=np.int64)
    rate[order] = np.concatenate([[0], np.cumsum(np.diff(rise[order]) > SAME_RATE)])
    several = [len(np.unique(number[rate == r])) > 1 for r in np.unique(rate)]
    return bool(np.mean(several) > 0.5)


def _rise(part: Rows, depth: float) -> float:
    """Return the natural logarithm of the time from a fifth of a depth to it [s]."""
    tip = part.tip[:, 2]
    first, last = int(np.argmax(tip >= 0.2 * depth)), int(np.argmax(tip >= depth))
    return float(np.log(max(part.time[last] - part.time[first], 1e-3)))


def _level(part: Rows, depth: float, channels: int) -> float:
    """Return the rise of a press above idle when it first reaches a depth, root mean square over channels."""
    read = np.isfinite(part.values[:, :channels]).all(axis=1)
    tip, values = part.tip[read, 2], part.values[read, :channels]
    top = int(np.argmax(tip))
    idle = np.median(values[: max(int(np.argmax(tip > TOUCHED * tip[top])), 1)], axis=0)
    reached = np.maximum.accumulate(tip[: top + 1])
    at = min(int(np.searchsorted(reached, depth)), top)
    return float(np.sqrt(np.mean(np.square(np.mean(values[max(at - 1, 0) : at + 2], axis=0) - idle))))
