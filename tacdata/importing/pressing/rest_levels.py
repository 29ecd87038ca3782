"""The channels' readings at rest from recording to recording: an offset that was set in between shows there."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class RestPolicy:
    """Limits of a rest that is one. None was tuned on data."""

    share: float = 0.1
    """Share of the stroke at both of its ends that counts as rest and as full depth [1]."""
    rows: int = 3
    """Fewest rows of either [rows]."""
    change: float = 0.5
    """Smallest change of the rest from one recording to the next [answer]."""
    faster: float = 5.0
    """The same [usual change]. A drift changes it from each to the next."""


POLICY = RestPolicy()


@dataclass(frozen=True)
class RestLevel:
    """Rest of a recording's channels."""

    trial: str
    rest: np.ndarray
    """Median reading at rest [channels' unit], shape (channels,)."""
    answer: np.ndarray
    """Size of the change up to full depth [channels' unit], shape (channels,)."""


def rest_level(trial: str, depth: np.ndarray, values: np.ndarray, policy: RestPolicy = POLICY) -> RestLevel | None:
    """Return the rest of a recording; None if the path has no rest and no full depth.

    Args:
        trial: Its name.
        depth: Depth at each reading [mm], shape (rows,).
        values: Readings [channels' unit], shape (rows, channels).
        policy: The limits.
    """
    stroke = float(np.ptp(depth)) if len(depth) else 0.0
    low, high = depth <= depth.min() + policy.share * stroke, depth >= depth.max() - policy.share * stroke
    if stroke <= 0 or min(low.sum(), high.sum()) < policy.rows or np.isnan(values[low]).all(axis=0).any():
        return None
    if np.isnan(values[high]).all(axis=0).any():
        return None
    rest = np.nanmedian(values[low], axis=0)
    return RestLevel(trial, rest, np.abs(np.nanmedian(values[high], axis=0) - rest))


def rest_doubt(levels: list[RestLevel], policy: RestPolicy = POLICY) -> str:
    """Return a note on a rest that is another from one recording on; "" if there is none."""
    if len(levels) < 2 or len({len(level.rest) for level in levels}) > 1:
        return ""
    changes = np.abs(np.diff([level.rest for level in levels], axis=0))
    answer = np.median([level.answer for level in levels], axis=0)
    usual = np.median(changes, axis=0) if len(changes) > 2 else changes.min(axis=0) * (len(changes) > 1)
    large = (changes > policy.change * answer) & (changes > policy.faster * usual) & (answer > 0)
    if not large.any():
        return ""
    row = int(np.flatnonzero(large.any(axis=1))[0])
    channel = int(np.argmax(np.where(large[row], changes[row], 0.0)))
    before, behind = list(pairwise(levels))[row]
    return (
        f"the readings at rest differ by {changes[row, channel]:.4g} between {before.trial or 'one recording'} and "
        f"{behind.trial or 'the next'}, {changes[row, channel] / answer[channel]:.2g} times their answer to a press: "
        "was an offset set in between?"
    )
