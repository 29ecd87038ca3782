"""One harness for tests without a form: the largest of many statistics compared with chance, at one rate.

Each alarm makes its draws (flips of sign, permutations) so that they contain the effect of noise, or knows how its
statistics are distributed. The level is that of all its statistics together, and the same for every alarm: by the
largest of each draw (Westfall & Young, Resampling-Based Multiple Testing, 1993), or by Bonferroni's correction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

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
    return highest(z)


def highest(scores: np.ndarray) -> Largest:
    """Return the highest score.

    Args:
        scores: As normal numbers [1], observed first, then draws, shape (1 + draws, statistics).
    """
    at = int(np.argmax(scores[0]))
    p = float((1 + (scores[1:].max(axis=1) >= scores[0, at]).sum()) / len(scores))
    return Largest(at, float(scores[0, at]), p)


def rarest(tails: np.ndarray) -> Largest:
    """Return the rarest of statistics whose distribution under the null is known, with Bonferroni's correction.

    Args:
        tails: Probability that each is as large under the null [1], shape (statistics,); 1 for those that do not count.
    """
    at = int(np.argmin(tails))
    return Largest(at, float(-ndtri(max(tails[at], 1e-300))), float(min(tails[at] * np.sum(tails < 1), 1.0)))
