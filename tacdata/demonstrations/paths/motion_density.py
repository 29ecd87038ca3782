"""Chooses the process noise of a finger's motion by maximum likelihood."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tacdata.demonstrations.paths.motion_filter import ProcessNoise, smooth
from tacdata.demonstrations.paths.sightings import Sightings

VELOCITIES = (0.0001, 0.001, 0.01, 0.1, 1.0, 10.0, 100.0)
"""Spectral densities of the acceleration in the search grid [(m/s^2)^2 s]."""
TURNINGS = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0, 10000.0)
"""Spectral densities of the angular acceleration in the search grid [(rad/s^2)^2 s]."""
BLOCKS, BLOCK = 8, 100
"""Number of stretches of a long recording that are used, and sightings in each: a hand rests and moves fast in turn."""


def choose(sightings: Sightings) -> ProcessNoise:
    """Return the densities, out of `VELOCITIES` and `TURNINGS`, with the largest likelihood.

    Stretches from the whole recording count. The beginning alone underestimates the noise of fast motion later.
    """
    parts, nothing = _stretches(sightings), np.zeros(0, np.int64)

    def likelihood(velocity: float, turning: float) -> float:
        noise = ProcessNoise(velocity, turning)
        return sum(smooth(part, nothing, noise, back=False).log_likelihood for part in parts)

    velocity = _climb(VELOCITIES, lambda value: likelihood(value, TURNINGS[len(TURNINGS) // 2]))
    return ProcessNoise(velocity, _climb(TURNINGS, lambda value: likelihood(velocity, value)))


def _stretches(sightings: Sightings) -> list[Sightings]:
    """Return stretches of sightings spread evenly over all, or all of a short recording."""
    if len(sightings) <= BLOCKS * BLOCK:
        return [sightings]
    stretches = []
    # The likelihood of a long recording costs seconds for each density; some stretches choose the same one.
    for begin in np.linspace(0, len(sightings) - BLOCK, BLOCKS).astype(int):
        mask = np.zeros(len(sightings), bool)
        mask[begin : begin + BLOCK] = True
        stretches.append(sightings.where(mask))
    return stretches


def _climb(values: Sequence[float], worth: Callable[[float], float]) -> float:
    """Return the value of largest ``worth``, by hill climbing from the middle: the likelihood has one maximum."""
    evaluations: dict[int, float] = {}

    def at(k: int) -> float:
        if k not in evaluations:
            evaluations[k] = worth(values[k]) if 0 <= k < len(values) else -np.inf
        return evaluations[k]

    best = len(values) // 2
    while (better := max((best - 1, best, best + 1), key=at)) != best:
        best = better
    return values[best]
