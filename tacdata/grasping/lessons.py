"""Turns solved presses into training sequences of readings and maps, as if a guide had pressed at 30 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.grasping.press_set import PressSet
from tacdata.grasping.touch import FingertipSpread, mirrored
from tacdata.sensor import Sensor

REST, HELD = 5, 8
"""Frames without contact at either end, and at full depth [count]."""
RAMP = (6, 14)
"""Fewest and most frames of loading, and of unloading [count]."""


@dataclass(frozen=True, eq=False)
class Lesson:
    """One press as a sequence."""

    taxels: np.ndarray
    """Tared readings [counts], shape (n, taxels), float32."""
    depth: np.ndarray
    """Maps of the same frames [mm], shape (n, pixels_x, pixels_y), float32, not negative."""
    tip: np.ndarray
    """x, y and depth of the indenter [mm], shape (n, 3), float32."""
    indenter: str
    """Shape and size of the indenter, as text."""
    shape: str
    """Its file in tacdata/indenters."""


def lessons(presses: PressSet, sensor: Sensor, spread: FingertipSpread, seed: int = 0) -> list[Lesson]:
    """Return every press four times: as solved, and mirrored along x, y and both, each with its own noise.

    The training fingertip has the sensor file's gains; those of the study differ.
    """
    rng, signals, examples = np.random.default_rng([seed, 33]), presses.signals(sensor), []
    # A press without a second state has no depth to interpolate.
    for k in np.flatnonzero(presses.counts > 1).tolist():
        q = int(presses.counts[k])
        levels, document = presses.depths[k, :q], presses.indenters[k]
        sizes = ", ".join(f"{name} {value:g}" for name, value in document.items() if name != "shape")
        name = f"{document['shape']} {sizes}"
        for over_x, over_y in ((False, False), (True, False), (False, True), (True, True)):
            depth = _course(float(levels[-1]), rng)
            clean = _between(levels, signals[k, :q], depth)
            maps = np.maximum(_between(levels, presses.surface[k, :q], depth), 0.0)
            maps = maps[:, ::-1] if over_x else maps
            maps = maps[:, :, ::-1] if over_y else maps
            noisy = mirrored(clean, sensor, over_x, over_y) + rng.normal(0.0, spread.noise, clean.shape)
            x, y = presses.place[k, :2] * np.where([over_x, over_y], -1, 1)
            tip = np.column_stack([np.full(len(depth), x), np.full(len(depth), y), depth])
            # It was tared before an earlier press, so the drift since then remains, as in the study.
            tared = noisy - noisy[:REST].mean(axis=0) + rng.normal(0.0, spread.drift, clean.shape[1])
            taxels, depths, tips = (values.astype(np.float32) for values in (tared, maps, tip))
            examples.append(Lesson(taxels, depths, tips, name, document["shape"]))
    return examples


def _course(deepest: float, rng: np.random.Generator) -> np.ndarray:
    down, up = (int(rng.integers(RAMP[0], RAMP[1] + 1)) for _ in range(2))
    return np.concatenate(
        [
            np.zeros(REST),
            np.linspace(0, deepest, down + 2)[1:-1],
            np.full(HELD, deepest),
            np.linspace(deepest, 0, up + 2)[1:-1],
            np.zeros(REST),
        ]
    )


def _between(levels: np.ndarray, values: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return values (k, ...) at depths between the levels, linear, shape (n, ...)."""
    above = np.clip(np.searchsorted(levels, depth), 1, len(levels) - 1)
    share = ((depth - levels[above - 1]) / (levels[above] - levels[above - 1])).reshape(-1, *[1] * (values.ndim - 1))
    return values[above - 1] * (1 - share) + values[above] * share
