"""Cuts one grasp out of a demonstration, and places its object: by the readings, not by a network's estimate.

A predicted depth decides the robot's command. If it decided the object's place as well, its errors would move both, and
a replay could not show them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.errors import UsageError
from tacdata.replay.targets import FingertipTargets

FELT, ONSET = 0.5, 0.1
"""Shares of a finger's strongest readings from which it presses, and from which it touches [1]."""
STRONGEST = 0.98
"""Quantile of a finger's readings that counts as its strongest [1]: single readings may be wrong."""
LEAST_COUNTS = 25.0
"""Smallest sum of readings that counts as pressing [counts]."""
CONTACT_DEVIATION = 0.001
"""Standard deviation of a contact's place along a pad [m]: few fingers may agree by chance."""
BEFORE, AFTER = 1.0, 0.2
"""Time before and after the touch that belongs to a grasp [s]."""
SHORT = 0.5
"""Shortest touch that counts as a grasp [s]."""


@dataclass(frozen=True, eq=False)
class ObjectPlace:
    """Position of an object before it is touched."""

    centre: np.ndarray
    """[m], shape (3,)."""
    spread: np.ndarray
    """Standard deviation of each axis [m], shape (3,)."""
    source: str
    """Origin of the position, in words."""

    @property
    def document(self) -> dict[str, object]:
        """The place as plain data."""
        return {"position": self.centre.tolist(), "spread": self.spread.tolist(), "source": self.source}

    @property
    def text(self) -> str:
        """The place in a sentence."""
        x, y, z = self.centre
        spread = " x ".join(f"{1000 * v:.1f}" for v in self.spread)
        return f"the object is at ({x:.4f}, {y:.4f}, {z:.4f}) m, known to {spread} mm, by {self.source}"


def touched(targets: FingertipTargets) -> tuple[np.ndarray, np.ndarray]:
    """Return each finger's readings [counts], none below 0, and when it touches; shapes (n, f).

    Raises:
        UsageError: If a finger has none.
    """
    if targets.readings is None:
        raise UsageError(
            f"no readings of all of {', '.join(targets.fingers)}",
            "fingers with boards",
            "record them with boards, or name the fingers that have one",
        )
    level = np.maximum(np.nan_to_num(targets.readings), 0.0)
    return level, level > ONSET / FELT * _pressing_level(level)


def _pressing_level(level: np.ndarray) -> np.ndarray:
    """Return the readings from which each finger presses [counts], shape (f,)."""
    return np.maximum(FELT * np.quantile(level, STRONGEST, axis=0), LEAST_COUNTS)


def touching(targets: FingertipTargets) -> np.ndarray:
    """Return when all fingers press at once, shape (n,), bool.

    Raises:
        UsageError: If a finger has no readings.
    """
    level, _ = touched(targets)
    return np.all(level > _pressing_level(level), axis=1)


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
        f"a demonstration in which all of {', '.join(targets.fingers)} touch",
        "record from open hand to open hand",
    )


def felt_place(targets: FingertipTargets, touch: int, reach: float) -> ObjectPlace:
    """Return the position of an object by the first touch of each finger.

    There a pad meets the object without pressing it, so that the centre is ``reach`` [m] along its normal.

    Args:
        targets: Whole targets of a demonstration.
        touch: Row in which all fingers press.
        reach: Half the object's width between the fingers [m].
    """
    free = ~touched(targets)[1][: touch + 1]
    # The row after the last one without touch; the first where the finger touches from the beginning.
    rows = np.where(free.any(axis=0), len(free) - np.argmax(free[::-1], axis=0), 0).clip(max=touch)
    fingers = np.arange(len(targets.fingers))
    each = targets.seen[rows, fingers] + reach * targets.normals[rows, fingers]
    scatter = np.zeros(3) if len(each) < 2 else each.var(axis=0, ddof=1)
    variance = np.maximum(scatter, CONTACT_DEVIATION**2) / len(each)
    if targets.source is not None:
        paths = [targets.source.tracks[name].covariance[targets.rows] for name in targets.fingers]
        # Cameras are off for all fingers at once, so that their mean is known no better than one of them.
        variance = variance + np.max([np.diagonal(p[r])[3:] for p, r in zip(paths, rows, strict=True)], axis=0)
    return ObjectPlace(each.mean(axis=0), np.sqrt(variance), "the readings' first touch and the fingertips' paths")


def cut(targets: FingertipTargets, begin: int, end: int) -> FingertipTargets:
    """Return the targets of some rows."""
    rows, first = slice(begin, end), targets.rows.start or 0
    arrays = ("time_ns", "position", "quaternion", "seen", "depth", "gap")
    slices = {name: getattr(targets, name)[rows] for name in arrays}
    if targets.readings is not None:
        slices["readings"] = targets.readings[rows]
    return replace(targets, **slices, rows=slice(first + begin, first + end))
