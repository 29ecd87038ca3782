"""The faults that are planted at the second visit, and the advice that each should bring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from unit_visits import SENSOR, Fault

from tacdata.health.advice import RECALIBRATE, REGISTER, TARE, WIRING

COUNT = SENSOR.taxels.count
COLUMNS = SENSOR.taxels.columns
SIDE = 0.15
"""How much deeper a tool presses [mm]."""


@dataclass(frozen=True)
class Planted:
    """A fault and the right advice."""

    fault: Fault
    do: str
    channels: frozenset[int]
    """Channels that the advice should name; none if it concerns the unit."""


def gain_of_one(rng: np.random.Generator) -> Planted:
    """Let one channel answer 20 % less."""
    k = int(rng.integers(COUNT))
    weaker = np.where(np.arange(COUNT) == k, 0.8, 1.0)
    fault = Fault(truth=lambda truth, _: replace(truth, gain=tuple(np.array(truth.gain) * weaker)))
    return Planted(fault, RECALIBRATE, frozenset({k}))


def gain_of_all(rng: np.random.Generator) -> Planted:
    """Let all channels answer 10 % less."""
    fault = Fault(truth=lambda truth, _: replace(truth, gain=tuple(0.9 * np.array(truth.gain))))
    return Planted(fault, RECALIBRATE, frozenset())


def channel_stands_still(rng: np.random.Generator) -> Planted:
    """Let one channel read the same number always."""
    k = int(rng.integers(COUNT))
    fault = Fault(counts=lambda counts, _: np.where(np.arange(COUNT) == k, 9000.0, counts))
    return Planted(fault, WIRING, frozenset({k}))


def wire_broken(rng: np.random.Generator) -> Planted:
    """Let one channel read noise alone."""
    k = int(rng.integers(COUNT))
    dead = np.where(np.arange(COUNT) == k, 0.0, 1.0)
    fault = Fault(truth=lambda truth, _: replace(truth, gain=tuple(np.array(truth.gain) * dead)))
    return Planted(fault, WIRING, frozenset({k}))


def neighbours_swapped(rng: np.random.Generator) -> Planted:
    """Swap two channels that lie side by side, which are the hardest to tell."""
    while True:
        k = int(rng.integers(COUNT))
        j = k + (1 if rng.random() < 0.5 else COLUMNS)
        if j < COUNT and (j != k + 1 or j % COLUMNS):
            break
    order = np.arange(COUNT)
    order[[k, j]] = j, k
    return Planted(Fault(counts=lambda counts, _: counts[:, order]), WIRING, frozenset({k, j}))


def any_two_swapped(rng: np.random.Generator) -> Planted:
    """Swap two channels."""
    k, j = (int(c) for c in rng.permutation(COUNT)[:2])
    order = np.arange(COUNT)
    order[[k, j]] = j, k
    return Planted(Fault(counts=lambda counts, _: counts[:, order]), WIRING, frozenset({k, j}))


def noise_of_all(rng: np.random.Generator) -> Planted:
    """Make all channels three times as noisy."""
    return Planted(Fault(truth=lambda truth, _: replace(truth, noise=3 * truth.noise)), WIRING, frozenset())


def noise_of_one(rng: np.random.Generator) -> Planted:
    """Make one channel three times as noisy."""
    k, draws = int(rng.integers(COUNT)), np.random.default_rng(rng.integers(1 << 30))

    def louder(counts: np.ndarray, _: np.ndarray) -> np.ndarray:
        more = np.sqrt(8) * 5.0 * draws.standard_normal(len(counts))
        return np.round(counts + np.where(np.arange(COUNT) == k, more[:, None], 0.0))

    return Planted(Fault(counts=louder), WIRING, frozenset({k}))


def zero_drifts(rng: np.random.Generator) -> Planted:
    """Shift the zero of one channel by 300 counts, and let it drift by 3 counts/s."""
    k = int(rng.integers(COUNT))

    def drifting(counts: np.ndarray, seconds: np.ndarray) -> np.ndarray:
        return np.round(counts + np.where(np.arange(COUNT) == k, 300.0 + 3.0 * seconds[:, None], 0.0))

    return Planted(Fault(counts=drifting), TARE, frozenset({k}))


def tool_too_low(rng: np.random.Generator) -> Planted:
    """Let the tip stand `SIDE` deeper than commanded."""

    def lower(truth, _):
        x, y, z = truth.registration.origin
        return replace(truth, registration=replace(truth.registration, origin=(x, y, z + SIDE)))

    return Planted(Fault(truth=lower), REGISTER, frozenset())


KINDS: dict[str, Callable[[np.random.Generator], Planted]] = {
    "gain of one channel -20 %": gain_of_one,
    "gain of all channels -10 %": gain_of_all,
    "a channel stands still": channel_stands_still,
    "a broken wire": wire_broken,
    "two neighbours swapped": neighbours_swapped,
    "any two swapped": any_two_swapped,
    "noise of all x 3": noise_of_all,
    "noise of one x 3": noise_of_one,
    "zero of one drifts": zero_drifts,
    "tool 0.15 mm too low": tool_too_low,
}
