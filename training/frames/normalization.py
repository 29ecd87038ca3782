"""Mean and deviation of each channel over training frames, by which networks scale readings."""

from __future__ import annotations

import numpy as np


def normalization(taxels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and deviation of each channel [counts or N], (taxels,), float32, of readings (n, taxels).

    A channel that never moves gets a deviation of 1, so that it stays at 0 instead of becoming noise.
    """
    mean, sd = taxels.mean(axis=0, dtype=np.float64), taxels.std(axis=0, dtype=np.float64)
    still = sd <= 1e-6 * np.maximum(np.abs(mean), 1.0)
    return mean.astype(np.float32), np.where(still, 1.0, sd).astype(np.float32)
