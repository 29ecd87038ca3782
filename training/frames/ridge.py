"""Ridge regression of each pixel of a map on the readings of one frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tacdata.training.frames.frames import Frames

RIDGE = 1e-3
"""Ridge as a share of the mean variance of the readings [1]: the unit of the readings does not matter."""
FRAMES = 4096
"""Frames whose products are summed together [count]."""


def products(frames: Frames, presses: tuple[int, ...]) -> np.ndarray:
    """Return the sum over the frames of presses of (1, readings) times (1, readings, label).

    Shape (taxels + 1, taxels + 1 + pixels). Sums of presses add up, so that a press is left out by a difference.
    """
    chosen, top = frames.indices(presses), frames.sensor.map.depth_max
    taxels, pixels = frames.taxels.shape[1], int(np.prod(frames.sensor.map.shape))
    total = np.zeros((taxels + 1, taxels + 1 + pixels))
    for start in range(0, len(chosen), FRAMES):
        part = chosen[start : start + FRAMES]
        readings = _with_one(frames.taxels[part])
        total += readings.T @ np.hstack([readings, frames.depth[part].reshape(len(part), pixels).clip(0.0, top)])
    return total


def regression(products: np.ndarray) -> np.ndarray:
    """Return the coefficients of (1, readings) for each pixel [mm, mm/count], shape (taxels + 1, pixels)."""
    gram, cross = np.split(products, [len(products)], axis=1)
    count, taxels = gram[0, 0], len(gram) - 1
    variance = (np.trace(gram) - count) / count - np.square(gram[0, 1:] / count).sum()
    penalty = count * (RIDGE * variance / taxels + 1e-12) * np.eye(taxels + 1)
    # The constant is not drawn to zero.
    penalty[0, 0] = 0.0
    return np.linalg.solve(gram + penalty, cross)


def predicted(taxels: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return the pixels that a regression predicts [mm], shapes (m, taxels) and (taxels + 1, pixels) -> (m, pixels)."""
    return _with_one(taxels) @ coefficients


def _with_one(taxels: np.ndarray) -> np.ndarray:
    return np.insert(taxels.astype(np.float64), 0, 1.0, axis=1)
