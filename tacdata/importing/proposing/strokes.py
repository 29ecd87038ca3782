"""How the pressing axis moves: its sign, its pauses and its strokes."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.importing.pressing.press_path import strokes
from tacdata.importing.times import NEVER

PAUSE, TIMES = 1.0, 10.0
"""A pause is longer than this [s], and than this many steps between rows."""
SURE = 0.5
"""Correlation of position and readings above which the sign is certain."""
LEAP = 2e7
"""A step ahead that is no pause: the clock was set [s]."""
LIFTED, CLEAR = 0.2, 0.05
"""A length that stays farther from 0 than this share of its range is a height. Presses are cut at the other."""


@dataclass(frozen=True)
class PressingAxis:
    """Properties of the path along the pressing axis."""

    sign: int
    """1 where the axis grows into the skin, -1 where it falls."""
    at_zero: bool
    """Whether 0 is among its values, or just outside their range."""
    lifted: bool
    """Whether it never comes near zero, as a machine's height and no depth does."""
    pause: float
    """Longer than any step within trials, shorter than any pause between them [s]; 0 without pauses."""
    pauses: int
    strokes: int
    """How often it goes down and comes back between two pauses, at most."""
    above: float
    """Depth that cuts strokes apart [as in the file]."""


def pressing_axis(
    time_ns: np.ndarray, axis: np.ndarray, deviation: np.ndarray | None, *, pauses: bool = True
) -> PressingAxis:
    """Return how an axis moves.

    Args:
        time_ns: Time of each row [ns], shape (rows,).
        axis: Its position [as in the file], shape (rows,).
        deviation: How far the readings are from rest (any scale), shape (rows,); None if not known.
        pauses: Whether pauses of the clock are looked for.

    Raises:
        ValueError: If fewer than three rows have both.
    """
    valid = np.isfinite(axis) & (time_ns != NEVER)
    if valid.sum() < 3:
        raise ValueError("fewer than three rows with a time and a position")
    known = np.isfinite(deviation) & (time_ns != NEVER) if deviation is not None else valid
    if deviation is not None and (known & valid).sum() < 3 <= known.sum():  # rows of position and readings alternate
        deviation = np.interp(time_ns, time_ns[known], deviation[known])
    time_ns, axis = time_ns[valid], axis[valid]
    sign = 1 if axis.mean() >= axis[0] else -1  # a trial begins away from the skin
    if (
        deviation is not None
        and np.ptp(axis) > 0
        and np.isfinite(deviation[valid]).any()
        and (np.nanstd(deviation[valid]) > 0)
    ):
        joint = np.isfinite(deviation[valid])
        correlation = float(np.corrcoef(axis[joint], deviation[valid][joint])[0, 1])
        sign = sign if abs(correlation) < SURE else int(np.sign(correlation))
    low, high = np.sort(np.abs([axis.min(), axis.max()]))
    margin = CLEAR * np.ptp(axis)
    at_zero = bool(axis.min() <= margin and axis.max() >= -margin)
    lifted = bool(axis.min() * axis.max() > 0 and low > LIFTED * (high - low))
    steps = np.diff(time_ns) / 1e9
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    long = np.sort(steps[pauses & (steps > PAUSE) & (steps > TIMES * usual) & (steps < LEAP)])
    pause = float(f"{(long[0] + max(steps[steps < long[0]], default=0.0)) / 2:.2g}") if len(long) else 0.0
    down = sign * axis - (sign * axis).min()
    edges = [0, *(np.flatnonzero(steps > pause) + 1).tolist(), len(down)] if pause else [0, len(down)]
    count = max(strokes(down[a:b], CLEAR * down.max()) for a, b in pairwise(edges))
    return PressingAxis(sign, at_zero, lifted, pause, len(long), count, float(f"{2 * CLEAR * np.ptp(axis):.2g}"))
