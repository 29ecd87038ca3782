"""Readings that repeat the row before although they have noise: a logger without a new reading writes the last one."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RepeatPolicy:
    """Limits of readings that repeat. None was tuned on data."""

    run: int = 10
    """Fewest equal readings in a row that are old ones [rows]."""
    usual: float = 0.05
    """Largest share of other readings of that size that equal the one before [1]; coarse steps have more."""
    near: float = 0.05
    """Largest difference of readings of one size [their range]."""
    updates: int = 20
    """Fewest changes of the readings that show their own rate [count]."""
    every: int = 3
    """Fewest rows between two changes for a rate of their own [rows]."""


POLICY = RepeatPolicy()


def without_repeats(values: np.ndarray, name: str, policy: RepeatPolicy = POLICY) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return readings with NaN for those that only repeat an old one, and their counts as sentences.

    Args:
        values: The readings [any], shape (rows, k).
        name: Their stream, for the sentences.
        policy: The limits.
    """
    old = np.zeros(values.shape, dtype=bool)
    for column in range(values.shape[1]):
        old[:, column] = _old(values[:, column], policy)
    doubts = []
    if old.any():
        row = int(np.flatnonzero(old.any(axis=1))[0])
        doubts.append(
            f"{name}: {int(old.sum())} readings repeat an old one for {policy.run} rows or more, and others of their "
            f"size never do, the first in row {row + 1}: they are missing (trusted: true keeps them)"
        )
    changed = np.flatnonzero((values[1:] != values[:-1]).any(axis=1))
    if len(changed) >= policy.updates and (interval := int(np.median(np.diff(changed)))) >= policy.every:
        doubts.append(f"{name}: the readings change every {interval} rows only; the rows in between repeat them")
    return (np.where(old, np.nan, values) if old.any() else values), tuple(doubts)


def _old(column: np.ndarray, policy: RepeatPolicy) -> np.ndarray:
    """Return which readings are copies in a long run of equal ones, shape (rows,), bool.

    Elsewhere readings of about the same size must have noise: a channel at rest may be quiet. At its largest or
    smallest reading it may saturate.
    """
    equal = np.concatenate([[False], column[1:] == column[:-1]])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    old = np.zeros(len(column), dtype=bool)
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        # At an end of its range a reading may rest: idle, or at a rail.
        if end - begin + 1 < policy.run or column[begin] in (np.nanmin(column), np.nanmax(column)):
            continue
        near = np.abs(column - column[begin]) <= policy.near * (np.nanmax(column) - np.nanmin(column))
        near[begin - 1 : end] = False
        old[begin:end] = near.sum() >= policy.run and equal[near].mean() <= policy.usual
    return old
