"""One recording may hold many strokes: each is an episode of its own to the statistics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

UP, DOWN = 0.6, 0.25
"""Shares of the range of depth that a stroke must pass on its way down and up again [1]."""


def strokes(time_ns: np.ndarray, depth: np.ndarray) -> list[tuple[int, int]]:
    """Return the time spans of strokes [ns], touching one another, from the point between them nearest to rest.

    Args:
        time_ns: Times of the path [ns], shape (k,), int64.
        depth: Depth of the tip [mm], shape (k,).
    """
    full_span = (int(time_ns[0]), int(time_ns[-1]) + 1)
    low, high = float(depth.min()), float(depth.max())
    if high - low <= 0:
        return [full_span]
    share = (depth - low) / (high - low)
    if min(share[0], share[-1]) > UP:
        # An axis that points the other way: the path comes from its largest value and returns to it.
        share = 1 - share
    tops, deep = [], False
    for i, value in enumerate(share.tolist()):
        if value > UP and not deep:
            deep = True
            tops.append(i)
        elif value < DOWN:
            deep = False
    if len(tops) < 2:
        return [full_span]
    cuts = []
    for first, second in pairwise(tops):
        between = share[first:second]
        lowest = np.flatnonzero(between <= between.min() + 1e-9)
        # In the middle of the time at rest: idle readings before and after a stroke then belong to it.
        middle = first + int(lowest[len(lowest) // 2])
        cuts.append(int(time_ns[middle]))
    edges = [full_span[0], *cuts, full_span[1]]
    return list(pairwise(edges))
