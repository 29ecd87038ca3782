"""Lag between images and touch: a skin is pressed deeper as two fingers close, and never else.

Images that are late by the same time from beginning to end look right by themselves, and so do two such cameras. Touch
shows it. The reading of a finger falls with its distance from the opposite finger, whatever the law. So the lag is the
one at which a falling function of distance explains the readings best (isotonic regression). Only the closing and the
opening of a hand determine it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tacdata.demonstrations.demonstration import FingerTrack

LAGS = np.arange(-0.6, 0.601, 0.01)
"""Lags that are tried [s], shape (m,)."""
SHORTEST = 0.05
"""Smallest lag that counts [s]; one camera on an idle computer shows up to 0.03, two 0.01."""
BETTER = 2.0
"""Ratio of the mean squared residuals without and with the lag, from which it counts [1]."""
BETWEEN = 0.15, 0.85
"""Shares of its largest reading between which a finger presses or lets go [1]."""
AROUND = 0.8
"""Time around these moments that is looked at [s]."""
FEWEST = 40
"""Smallest number of times of a finger that are looked at [count]."""
LEAST_COUNTS = 50.0
"""Smallest sum of readings that is a touch [counts]."""


def touch_lag(tracks: Mapping[str, FingerTrack], seconds: np.ndarray) -> float | None:
    """Return how much later images are than touch [s]; None if they agree, or no finger shows it.

    Args:
        tracks: Finger -> its path and readings.
        seconds: Their times [s], shape (n,).
    """
    total, count = np.zeros(len(LAGS)), 0
    for name, track in tracks.items():
        distance = _apart(name, tracks)
        if track.signals is None or distance is None:
            continue
        reading = np.nansum(np.abs(track.signals), axis=1)
        reading = reading - np.quantile(reading, 0.1)
        largest = float(np.quantile(reading, 0.95))
        if largest < LEAST_COUNTS:
            continue
        squares = _residuals(reading / largest, distance, seconds, ~track.gap)
        if squares is not None:
            total, count = total + squares, count + 1
    if not count:
        return None
    lag = float(LAGS[int(total.argmin())])
    without = float(np.interp(0.0, LAGS, total))
    return lag if abs(lag) >= SHORTEST and without > BETTER * total.min() else None


def _apart(name: str, tracks: Mapping[str, FingerTrack]) -> np.ndarray | None:
    """Return a finger's distance from the opposite one [m], shape (n,): the one whose pad faces it most."""
    rows = tracks[name]
    facing = {
        neighbour: float(np.nanmean((rows.normal * track.normal).sum(axis=1)))
        for neighbour, track in tracks.items()
        if neighbour != name
    }
    opposite = min(facing, key=lambda neighbour: facing[neighbour], default=None)
    if opposite is None or facing[opposite] > 0:
        return None
    return np.linalg.norm(rows.position - tracks[opposite].position, axis=1)


def _residuals(
    reading: np.ndarray, distance: np.ndarray, seconds: np.ndarray, visible: np.ndarray
) -> np.ndarray | None:
    """Return the sum of squared residuals at each lag [1], shape (m,); None where too little is pressed.

    Args:
        reading: Share of the largest reading [1], shape (n,).
        distance: Distance of the two fingers [m], shape (n,).
        seconds: Times [s], shape (n,).
        visible: Where the finger was seen, shape (n,), bool.
    """
    from scipy.optimize import isotonic_regression

    changing = seconds[(reading > BETWEEN[0]) & (reading < BETWEEN[1])]
    if not len(changing):
        return None
    nearest = np.clip(np.searchsorted(changing, seconds), 1, max(len(changing) - 1, 1))
    away = np.minimum(
        abs(seconds - changing[nearest - 1]), abs(seconds - changing[np.minimum(nearest, len(changing) - 1)])
    )
    # The same rows at every lag: else residuals of different rows would be compared.
    inside = (seconds > seconds[0] + LAGS[-1]) & (seconds < seconds[-1] - LAGS[-1])
    rows = (away < AROUND) & visible & np.isfinite(distance) & inside
    if rows.sum() < FEWEST:
        return None
    order = np.flatnonzero(rows)[np.argsort(distance[rows])]
    residuals = []
    for lag in LAGS:
        # How fast readings fall with the distance differs between fingers; only the direction is assumed.
        felt = np.interp(seconds[order] - lag, seconds, reading)
        residuals.append(float(((felt - isotonic_regression(felt, increasing=False).x) ** 2).sum()))
    return np.array(residuals)
