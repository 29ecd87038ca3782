"""Cuts one grasp out of a demonstration: from open fingers until they let go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.errors import UsageError
from tacdata.replay.targets import FingertipTargets

FELT = 0.5
"""Threshold of touch: share of a finger's largest depth [1]."""
LEAST_DEPTH = 0.05
"""Smallest maximum depth that counts as touch [mm]."""
BEFORE, AFTER = 1.0, 0.2
"""Time before and after the touch that belongs to a grasp [s]."""
SHORT = 0.5
"""Shortest touch that counts as a grasp [s]."""


def touching(targets: FingertipTargets) -> np.ndarray:
    """Return when all fingers touch at once, shape (n,), bool."""
    depth = np.nan_to_num(targets.depth)
    # A finger that never feels the least depth counts as one that never touches.
    return (depth > FELT * np.maximum(depth.max(axis=0), LEAST_DEPTH / FELT)).all(axis=1)  # ty: ignore[invalid-explicit-return]


def first_grasp(targets: FingertipTargets) -> tuple[int, int, int]:
    """Return rows of the first grasp that begins with open fingers: its beginning, first touch, and end.

    Raises:
        UsageError: If there is none.
    """
    touch = touching(targets)
    # Padded with no touch on both sides, so that edges come in pairs.
    edges = np.flatnonzero(np.diff(touch.astype(int), prepend=0, append=0))
    lead, tail = round(BEFORE * targets.rate), round(AFTER * targets.rate)
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if begin >= lead and end - begin >= SHORT * targets.rate:
            return begin - lead, begin, min(end + tail, len(touch))
    raise UsageError(
        "no grasp that begins with open fingers: they never all feel something for half a second",
        f"a demonstration in which all of {', '.join(targets.fingers)} touch, tracked with a network",
        "record from open hand to open hand, and track with --network",
    )


def cut(targets: FingertipTargets, begin: int, end: int) -> FingertipTargets:
    """Return the targets of some rows."""
    rows, first = slice(begin, end), targets.rows.start or 0
    arrays = ("time_ns", "position", "quaternion", "seen", "depth", "gap")
    slices = {name: getattr(targets, name)[rows] for name in arrays}
    return replace(targets, **slices, rows=slice(first + begin, first + end))
