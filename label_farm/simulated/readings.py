"""What a simulated board says: the transduction's readings with noise, drift and rounding."""

from __future__ import annotations

import numpy as np

from label_farm.simulated.plan import ReadingNoise


def board_counts(
    counts: np.ndarray, time_ns: np.ndarray, noise: ReadingNoise, full_scale: float | None, rng: np.random.Generator
) -> np.ndarray:
    """Return readings as a board sends them [counts], shape (n, taxels).

    Args:
        counts: What the transduction makes of the loads [counts], shape (n, taxels).
        time_ns: When each frame is sampled [ns], shape (n,), increasing.
        noise: What is laid on top.
        full_scale: Largest reading [counts]; None for no limit.
        rng: Random generator.
    """
    seconds = np.sqrt(np.diff(time_ns, prepend=time_ns[:1]) / 1e9)[:, None]
    drift = noise.drift * np.cumsum(seconds * rng.standard_normal(counts.shape), axis=0)
    found = counts + drift + noise.readings * rng.standard_normal(counts.shape)
    if noise.quantum:
        found = noise.quantum * np.round(found / noise.quantum)
    return found if full_scale is None else np.clip(found, 0.0, full_scale)
