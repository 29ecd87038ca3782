"""One harness for tests without a form: the largest of many statistics compared with that of draws under the null.

Each alarm makes its draws (flips of sign, permutations) so that they contain the effect of noise. The level is that of
all its statistics together (maxT: Westfall & Young, Resampling-Based Multiple Testing, 1993), and the same for every
alarm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DRAWS = 2000
"""Draws under the null."""
RATE = 0.001
"""Probability of a false alarm, over all statistics of one alarm [1]."""
LEAST_Z = 3.7
"""Least score, as a normal number: draws alone do not tell how rare a statistic is that none of them reaches [1]."""


@dataclass(frozen=True)
class Largest:
    """The largest statistic."""

    at: int
    """Which."""
    z: float
    """Its score, as a normal number [1]."""
    p: float
    """How often the largest of all is as large under the null [1]."""

    @property
    def alarms(self) -> bool:
        """Whether it is beyond chance."""
        return self.p <= RATE and self.z >= LEAST_Z


def largest(table: np.ndarray, counts: np.ndarray | None = None) -> Largest:
    """Return the largest statistic.

    Args:
        table: Sums of squares [1], observed first, then draws, shape (1 + draws, statistics).
        counts: Which may stand out, shape (statistics,), bool; all, unless given.
    """
    root = np.cbrt(np.maximum(table, 0.0))  # nearly normal (Wilson & Hilferty, PNAS 17, 1931, 684)
    middle, spread = root[1:].mean(axis=0), root[1:].std(axis=0)
    z = np.where(spread > 1e-9, (root - middle) / np.maximum(spread, 1e-9), 0.0)
    if counts is not None:
        z[0] = np.where(counts, z[0], np.minimum(z[0], 0.0))
    at = int(np.argmax(z[0]))
    p = float((1 + (z[1:].max(axis=1) >= z[0, at]).sum()) / len(z))
    return Largest(at, float(z[0, at]), p)
