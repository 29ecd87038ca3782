"""How far a finger may have gone where nothing was seen: as far as it went elsewhere in as much time.

A gap is bridged by the smoothest motion between its ends. How wrong that is shows where the finger was seen: the same
bridge is laid over every stretch as long as the gap. The largest error decides the process noise over the gap. The
noise that is likeliest for the whole recording would be too small: a hand rests most of the time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.demonstrations.paths.motion_filter import GAP, NS, ProcessNoise, Smoothed, logarithm, smooth
from tacdata.demonstrations.paths.sightings import Sightings

STEP = 1 / 30
"""Interval of the path on which bridges are laid [s]."""
SPREADS = 2.0
"""Standard deviations that the largest error of a bridge is made to be [1]."""
FEWEST = 15
"""Smallest number of bridges from which the largest error is taken; a gap with fewer is tried as a shorter one."""
MIDDLE = 192.0
"""Ratio q T^3 / variance in the middle of a bridge over T, whose ends are known, for a white acceleration of density q.
"""


def unseen_noise(sightings: Sightings, wander: ProcessNoise) -> ProcessNoise:
    """Return process noise with the one over gaps; unchanged without a gap.

    Args:
        sightings: At least two sightings.
        wander: Process noise of the whole recording.
    """
    breaks = np.diff(sightings.time_ns)
    gaps = breaks[breaks > GAP / NS] * NS
    if not len(gaps):
        return wander
    times = np.arange(sightings.time_ns[0], sightings.time_ns[-1], round(STEP / NS), dtype=np.int64)
    path = smooth(sightings, times, wander)
    # Only stretches that were seen can show how wrong a bridge over them would have been.
    hidden = np.array(~np.isfinite(path.position).all(axis=1), bool)
    for k in np.flatnonzero(breaks > GAP / NS):
        hidden[(times > sightings.time_ns[k]) & (times < sightings.time_ns[k + 1])] = True
    velocity, turning = _densities(path, hidden, float(gaps.max()))
    unseen = ProcessNoise(max(wander.velocity, velocity), max(wander.turning, turning))
    return replace(wander, unseen=unseen)


def _densities(path: Smoothed, hidden: np.ndarray, longest: float) -> tuple[float, float]:
    """Return the densities of acceleration and angular acceleration at which bridges are as wrong as they are."""
    largest = 0.0, 0.0
    for rows in _lengths(longest):
        begins = _begins(hidden, rows)
        if len(begins) < FEWEST:
            continue
        deviation, rotation_error = _errors(path, begins, rows)
        # The variance of white acceleration grows with the third power of the time between the ends.
        factor = MIDDLE / (rows * STEP) ** 3 / SPREADS**2
        largest = max(largest[0], factor * deviation**2), max(largest[1], factor * rotation_error**2)
    return largest


def _lengths(longest: float) -> list[int]:
    """Return even numbers of rows, from the shortest gap to the longest, by factors of about 1.5."""
    lengths, seconds = [], max(longest, GAP)
    while seconds >= GAP:
        lengths.append(2 * round(seconds / STEP / 2))
        seconds /= 1.5
    return lengths


def _begins(hidden: np.ndarray, rows: int) -> np.ndarray:
    """Return the first rows of stretches of ``rows`` steps in which nothing is hidden."""
    if len(hidden) <= rows + 2:
        return np.zeros(0, np.int64)
    total = np.concatenate([[0], np.cumsum(hidden)])
    clear = total[rows + 1 :] - total[: -rows - 1] == 0
    return np.flatnonzero(clear)


def _errors(path: Smoothed, begins: np.ndarray, rows: int) -> tuple[float, float]:
    """Return the largest error of a bridge in its middle, of an axis: position [m], rotation [rad]."""
    ends, middles = begins + rows, begins + rows // 2
    # The middle of the cubic with these places and velocities at its ends.
    bent = rows * STEP / 8 * (path.velocity[begins] - path.velocity[ends])
    middle = (path.position[begins] + path.position[ends]) / 2 + bent
    deviation = np.abs(path.position[middles] - middle).max()
    rotation_error = 0.0
    # Every third: each takes four logarithms of matrices.
    for a, m, b in zip(begins[::3], middles[::3], ends[::3], strict=True):
        first, second, last, penultimate = (
            logarithm(path.rotation[k] @ path.rotation[m].T) for k in (a, a + 1, b, b - 1)
        )
        bridge = (first + last) / 2 + rows / 8 * ((second - first) - (last - penultimate))
        rotation_error = max(rotation_error, float(np.abs(bridge).max()))
    return float(deviation), rotation_error
