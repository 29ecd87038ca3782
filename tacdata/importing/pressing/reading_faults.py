"""Faults of readings that show only against the depth: a zero that jumps at rest, and a channel that saturates."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tacdata.importing.streams import Stream


@dataclass(frozen=True)
class ReadingPolicy:
    """Limits of plausible readings. None was tuned on data."""

    rest: float = 0.1
    """Largest depth at which nothing touches [stroke]."""
    window: int = 5
    """Rows before and behind a jump that are all at rest [rows]."""
    jump: float = 0.1
    """Smallest jump at rest [readings' range]."""
    noise: float = 10.0
    """The same [their noise]."""
    sharp: float = 0.7
    """Smallest share of a jump between two rows [1]."""
    levels: int = 10
    """Fewest different readings of a channel that is judged [count]; one of fewer tells states."""
    run: int = 5
    """Fewest rows at a limit while the indenter moves [rows]."""
    usual: float = 0.05
    """Largest share of other readings that equal the one before while it moves [1]."""
    moves: float = 1e-3
    """Smallest step of a path that moves [stroke]."""


POLICY = ReadingPolicy()


def reading_doubts(
    stream: Stream, time_ns: np.ndarray, depth: np.ndarray, policy: ReadingPolicy = POLICY
) -> tuple[str, ...]:
    """Return doubts about readings, as sentences.

    Args:
        stream: The channels, or a force.
        time_ns: Times of the path [ns], shape (n,).
        depth: Its depths [mm], shape (n,).
        policy: The limits.
    """
    at = np.interp(stream.time_ns, time_ns, depth)
    stroke = float(np.ptp(at)) if len(at) else 0.0
    if stroke <= 0:
        return ()
    rest = at <= at.min() + policy.rest * stroke
    moving = np.concatenate([[False], np.abs(np.diff(at)) > policy.moves * stroke])
    jumps, limits = [], []
    for name, column in zip(stream.names, stream.values.T, strict=False):
        if len(np.unique(column[np.isfinite(column)])) <= policy.levels:
            continue
        jumps += [(row, size, name) for row, size in _jumps(column, rest, policy)]
        limits += [(name, *limit) for limit in _limits(column, moving, policy)]
    doubts = []
    if jumps:
        row, size, name = min(jumps)
        channels = len({each[2] for each in jumps})
        doubts.append(
            f"{stream.name}: readings of {channels} channel{'s' * (channels > 1)} jump while nothing touches, first "
            f"{name} by {size:.4g} at {stream.time_ns[row] / 1e9:.6g} s: was it tared, or its range switched, there?"
        )
    if limits:
        name, value, rows = limits[0]
        channels = f"{len(limits)} channel{'s saturate' if len(limits) > 1 else ' saturates'}"
        doubts.append(
            f"{stream.name}: {channels}: {name} stays at {value:.6g} for {rows} rows while the indenter moves; such "
            "readings count as measured"
        )
    return tuple(doubts)


def _jumps(column: np.ndarray, rest: np.ndarray, policy: ReadingPolicy) -> Iterator[tuple[int, float]]:
    """Yield the row and the size of each lasting jump of a channel at rest."""
    steps = np.abs(np.diff(column))
    low, high = np.nanquantile(column, [0.01, 0.99])
    # Steps of half a window hide a jump in their median; so the smaller of jump and range sets the scale.
    least = max(policy.jump * float(high - low), policy.noise * float(np.nanmedian(steps)))
    width = policy.window
    for row in np.flatnonzero(steps > policy.sharp * least).tolist():
        before, behind = slice(max(row + 1 - width, 0), row + 1), slice(row + 1, row + 1 + width)
        if row + 1 < width or row + 1 + width > len(column) or not (rest[before].all() and rest[behind].all()):
            continue
        size = abs(float(np.nanmedian(column[behind]) - np.nanmedian(column[before])))
        if size > least and steps[row] >= policy.sharp * size:
            yield row + 1, size


def _limits(column: np.ndarray, moving: np.ndarray, policy: ReadingPolicy) -> Iterator[tuple[float, int]]:
    """Yield each limit at which a channel stays while the indenter moves, and the number of rows there."""
    same = np.concatenate([[False], column[1:] == column[:-1]])
    for limit in (np.nanmax(column), np.nanmin(column)):
        there = column == limit
        elsewhere = moving & ~there
        # A reading of 0 below a threshold is a tared or clipped zero, as of a load cell that nothing touches.
        if limit == 0 or not elsewhere.any() or same[elsewhere].mean() > policy.usual:
            continue
        if (there & same & moving).sum() >= policy.run:
            yield float(limit), int(there.sum())
