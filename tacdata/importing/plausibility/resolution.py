"""Times that were stored in floating-point numbers too short for them, as 32 bits hold Unix seconds to 128 s."""

from dataclasses import dataclass

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.times import NEVER


@dataclass(frozen=True)
class ResolutionPolicy:
    """Limits of times that lost their resolution. None was tuned on data."""

    loss: float = 0.1
    """Smallest step of the stored numbers that is a loss [mean step of the rows]."""
    near: float = 2.0
    """Largest of the smallest steps between times that shows the numbers' own step [their step]."""
    distinct: int = 20
    """Fewest different times from which even times are restored [count]."""
    even: float = 1.0
    """Largest distance of a time from even ones [step of the stored numbers]."""


POLICY = ResolutionPolicy()
SHORT = {np.float16: "16", np.float32: "32"}
"""Floating-point numbers too short for some clocks, and their width [bit]."""


def restored(
    numbers: np.ndarray, time_ns: np.ndarray, where: str, policy: ResolutionPolicy = POLICY
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return times with even steps in place of ones that lost their resolution, and that in words.

    Args:
        numbers: The clock's numbers as in the file, shape (rows,).
        time_ns: The times made of them [ns], shape (rows,).
        where: The file and its clock, for messages.
        policy: The limits.

    Raises:
        FormatError: If too few different times are left to restore the others.
    """
    valid = np.isfinite(numbers) & (time_ns != NEVER)
    values = numbers[valid].astype(float)
    width, step = _stored(values, policy)
    if not width:
        return time_ns, ()
    times, rows = time_ns[valid], np.arange(len(values))
    second = float(np.ptp(times)) / float(np.ptp(values)) / 1e9
    fault = f"{where}: its times have the resolution of {width}-bit numbers, {step * second:.3g} s"
    if len(np.unique(values)) < policy.distinct:
        raise FormatError(
            f"{fault}, {len(np.unique(values))} different ones in {len(values)} rows",
            "times that tell the rows apart",
            "save the clock in 64 bits, or from the first row on; if the rate is known, give time: {rate: HZ}",
        )
    slope, first = np.polyfit(rows, values, 1)
    if np.abs(values - first - slope * rows).max() > policy.even * step:
        return time_ns, (f"{fault}: the distance of single rows is not known more closely",)
    even = np.array(time_ns)
    even[valid] = times[0] + np.rint((slope * rows) * second * 1e9).astype(np.int64)
    return even, (f"{fault}; the rows are evenly spaced within it and get even times",)


def _stored(values: np.ndarray, policy: ResolutionPolicy) -> tuple[str, float]:
    """Return the width [bit] of the numbers that held a clock, and their step; "" if nothing was lost."""
    steps = np.diff(values)
    rising = steps[steps > 0]
    if len(rising) < 2 or (steps < 0).any():
        return "", 0.0
    largest = float(np.abs(values).max())
    for kind, width in SHORT.items():
        with np.errstate(over="ignore"):
            stored = values.astype(kind)
        if not np.isfinite(stored).all() or (stored.astype(float) != values).any():
            continue
        step = float(np.spacing(kind(largest)))
        whole = step <= 1 and bool((values == np.rint(values)).all())
        lost = step > policy.loss * float(steps.mean()) and rising.min() <= policy.near * step
        # Equal steps are those of a clock that counts in such units.
        return (width, step) if lost and not whole and np.ptp(steps) >= 0.5 * step else ("", 0.0)
    return "", 0.0
