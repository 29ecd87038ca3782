"""A camera's own time stamps: whether they are of exposures, and where the camera's clock was set.

A camera exposes at a steady period and a host only delays. So stamps closer together than the period, or off its
multiples, are no lateness. Stamps of whole batches or in another unit are not of exposures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BUNCHED, MOST_BUNCHED = 0.3, 0.1
"""Interval of stamps that no exposure has, over the period [1]; largest share of such intervals [1]."""
SAME_UNIT = 0.5, 2.0
"""Ratio of the median intervals of stamps and arrivals between which both are in the same unit [1]."""
REGULAR, REGULAR_SHARE = 0.1, 0.9
"""Distance from a multiple of the period [periods] that nearly all intervals keep, and how many [1]."""
LEAST_STEP_NS = 3_000_000
"""Smallest deviation of an interval from a multiple of the period that is a step [ns]; stamps scatter by 1 ms."""
SCATTER = 8.0
"""The same, over the median deviation of all intervals [1]."""
ORDINARY, NEIGHBOURS = 0.3, 5
"""Largest deviation of an arrival's interval from the period [periods] on a host that keeps up, and images [count] to
either side that show it.
"""


@dataclass(frozen=True, eq=False)
class ExposureStamps:
    """Stamps of a camera that are of exposures."""

    order: np.ndarray
    """Images by exposure, as indices, shape (n,): neighbours may arrive in the wrong order."""
    begins: np.ndarray
    """Positions in that order where the camera's clock was set [index], shape (m,), ascending."""
    doubt_ns: np.ndarray
    """Lateness or a step of the clock, which of the two is not known: its size [ns], shape (n,), by that order."""


def exposure_stamps(arrival_ns: np.ndarray, device_ns: np.ndarray, rate: float | None) -> ExposureStamps | None:
    """Return the evidence of stamps; None if they are not of exposures.

    Args:
        arrival_ns: Host times of receipt [ns], shape (n,), int64, in the order of arrival.
        device_ns: Stamps [ns], shape (n,), int64; -1 for an image without one.
        rate: Nominal rate of the camera [Hz]; None if unknown.
    """
    if len(device_ns) < 3 or (device_ns < 0).any():
        return None
    order = _by_exposure(device_ns)
    stamps, arrivals = np.diff(device_ns[order]).astype(float), np.diff(arrival_ns[order]).astype(float)
    usual = float(np.median(stamps))
    between = (arrival_ns[-1] - arrival_ns[0]) / (len(arrival_ns) - 1)
    # Stamps given when a batch is fetched come in bunches, much closer than exposures can be.
    shortest = BUNCHED * min([between, *([1e9 / rate] if rate else [])])
    if not SAME_UNIT[0] < usual / max(float(np.median(arrivals)), 1.0) < SAME_UNIT[1]:
        # Batches also have a median interval of nearly nothing: both, then, are not of exposures.
        if not SAME_UNIT[0] < (usual / between) < SAME_UNIT[1]:
            return None
    if (stamps < shortest).mean() > MOST_BUNCHED:
        return None
    steps, doubt = _steps(stamps, arrivals)
    return ExposureStamps(order, np.flatnonzero(steps) + 1, doubt)


def _by_exposure(device_ns: np.ndarray) -> np.ndarray:
    """Return the order of images by exposure, shape (n,): that of stamps, where no two are nearer than exposures."""
    order = np.argsort(device_ns, kind="stable")
    intervals = np.diff(device_ns[order])
    # A clock that was set back leaves stamps of before and after among each other.
    if (intervals > (1 - REGULAR) * np.median(intervals)).all():
        return order
    return np.arange(len(device_ns))


def _steps(stamps: np.ndarray, arrivals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which intervals hold a step of the camera's clock, shape (n - 1,), and what may be one [ns], shape (n,).

    Args:
        stamps: Intervals of the stamps [ns], shape (n - 1,).
        arrivals: Intervals of the arrivals [ns], shape (n - 1,).
    """
    doubt = np.zeros(len(stamps) + 1)
    period = _period(stamps)
    turns = np.rint(stamps / period)
    off = np.abs(stamps - period * np.maximum(turns, 1))
    if (off < REGULAR * period).mean() < REGULAR_SHARE:
        # Without a steady period only a clock that was set back shows.
        return stamps < 0, doubt
    steps = off > max(LEAST_STEP_NS, SCATTER * float(np.median(off)))
    # Set forward by a multiple of the period, a clock looks as if lateness had ended just as images were lost. The
    # images before are then late, or they are not.
    ordinary = np.abs(arrivals - period) < ORDINARY * period
    for k in np.flatnonzero((turns > 1) & ~steps & ordinary):
        near = ordinary[max(k - NEIGHBOURS, 0) : k + NEIGHBOURS + 1]
        if near.all():
            doubt[: k + 1] += stamps[k] - arrivals[k]
    return steps, doubt


def _period(stamps: np.ndarray) -> float:
    """Return the period of exposures [ns], by the intervals of stamps [ns], shape (n - 1,)."""
    usual = float(np.median(stamps[stamps > 0])) if (stamps > 0).any() else 1.0
    near = stamps[np.abs(stamps - usual) < REGULAR * usual]
    return float(near.mean()) if len(near) else usual
