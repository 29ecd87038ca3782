"""Readings of a counter or converter that wrap: 0 follows 65535, or a signed number was read without its sign."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class WrapPolicy:
    """Criteria for a wrap. None was tuned on data."""

    bits: tuple[int, ...] = (8, 10, 12, 14, 16, 18, 20, 24, 32)
    """Widths of counters and converters [bit]."""
    near: float = 0.25
    """Largest distance of the readings before and behind a wrap from its limits [span]."""
    smooth: float = 3.0
    """Largest step across a wrap, once it is undone [usual steps]."""
    least: float = 2.0
    """The same [count]; readings at rest have no steps."""
    signed: int = 16
    """Smallest width at which a sign may have been lost [bit]."""


POLICY = WrapPolicy()


def unwrapped(
    values: np.ndarray, name: str, *, signed: bool, policy: WrapPolicy = POLICY
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return numbers with the wraps of their counter undone, and the wraps in words.

    Args:
        values: Numbers as in the file [any], shape (rows, k).
        name: Their stream, for the words.
        signed: Whether numbers about a wrap are taken for small ones with a sign. A position keeps its first turn.
        policy: The criteria.
    """
    result, doubts = np.array(values, dtype=float), []
    for column in range(values.shape[1]):
        rows = np.flatnonzero(np.isfinite(result[:, column]))
        span, steps = _wrap(result[rows, column], policy)
        if not span:
            continue
        continued = result[rows[0], column] + np.concatenate([[0.0], np.cumsum(_folded(steps, span))])
        if signed and span >= 2.0**policy.signed and continued.min() >= span / 2:
            continued = continued - span
        count = int((np.abs(steps) > span / 2).sum())
        first = int(rows[int(np.flatnonzero(np.abs(steps) > span / 2)[0]) + 1]) + 1
        doubts.append(
            f"{name}: numbers wrap {count} times at 2^{round(np.log2(span))}, first in row {first}, as of a counter or "
            "of a sign that was not read: they are continued (trusted: true keeps them)"
        )
        result[rows, column] = continued
    return (result if doubts else values), tuple(doubts)


def _folded(steps: np.ndarray, span: float) -> np.ndarray:
    return steps - span * np.round(steps / span)


def _wrap(column: np.ndarray, policy: WrapPolicy) -> tuple[float, np.ndarray]:
    """Return the span after which whole numbers wrap, and their steps; 0 if they do not."""
    steps = np.diff(column)
    if len(steps) < 10 or column.min() < 0 or (column != np.rint(column)).any():
        return 0.0, steps
    # The narrowest counter that holds all numbers; a wider one would not be full.
    span = next((2.0**bits for bits in policy.bits if column.max() < 2.0**bits), 0.0)
    jumps = np.abs(steps) > span / 2
    if not span or not jumps.any():
        return 0.0, steps
    folded = np.abs(_folded(steps, span))
    others = folded[~jumps & (folded > 0)]
    usual = float(np.quantile(others, 0.9)) if len(others) else 0.0
    before, behind = column[:-1][jumps], column[1:][jumps]
    high, low = np.maximum(before, behind), np.minimum(before, behind)
    at_limits = (high >= span * (1 - policy.near)).all() and (low <= span * policy.near).all()
    smooth = (folded[jumps] <= max(policy.smooth * usual, policy.least)).all()
    return (span, steps) if at_limits and smooth and len(others) else (0.0, steps)
