"""Readings of a simulated board: the transduction's with noise, drift and rounding."""

from __future__ import annotations

import numpy as np

from tacdata.label_farm.simulated.plan import ReadingNoise


def board_counts(
    counts: np.ndarray, time_ns: np.ndarray, noise: ReadingNoise, full_scale: float | None, rng: np.random.Generator
) -> np.ndarray:
    """Return readings as a board sends them [counts], shape (n, taxels).

    Args:
        counts: Readings of the transduction [counts], shape (n, taxels).
        time_ns: When each frame is sampled [ns], shape (n,), increasing.
        noise: Noise on top.
        full_scale: Largest reading [counts]; None for no limit.
        rng: Random generator.
    """
    # The steps of a random walk grow with the square root of time.
    seconds = np.sqrt(np.diff(time_ns, prepend=time_ns[:1]) / 1e9)[:, None]
    drift = noise.drift * np.cumsum(seconds * rng.standard_normal(counts.shape), axis=0)
    readings = counts + drift + noise.readings * rng.standard_normal(counts.shape)
    if noise.quantum:
        readings = noise.quantum * np.round(readings / noise.quantum)
    return readings if full_scale is None else np.clip(readings, 0.0, full_scale)
