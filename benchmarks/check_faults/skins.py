"""The skin of a session, drawn by its seed: responses differ between sessions and from the check's own model."""

import numpy as np
from scipy.signal import lfilter

OFFSET, SLOPE, NOISE = 9000.0, 2500.0, 5.0
"""Idle reading [counts], answer at 1 mm [counts], noise [counts]."""
INDENTERS = {"ball": (3.0, 1.0, 1.0), "small ball": (1.5, 0.8, 0.7)}
"""Name -> radius [mm], width and response relative to those of the first [1]."""


class Skin:
    """How readings follow the tip, in one session."""

    def __init__(self, seed, taxels, presses):
        """Draw it."""
        rng = np.random.default_rng([seed, 3])
        self.centers, self.presses = taxels.centers, presses
        self.half = np.abs(self.centers).max(axis=0)
        self.exponent = rng.uniform(1.0, 1.6)
        """Power of the depth."""
        self.width, self.widening = rng.uniform(1.6, 2.4), rng.uniform(0.0, 0.4)
        """Width of the excited region [mm], and by how much it grows with depth [1]."""
        self.creep, self.lasting = rng.uniform(0.0, 0.12), 10 ** rng.uniform(-1.3, 0.2)
        """Share of the answer that comes late [1], and how late [s]."""
        self.edge = rng.uniform(0.0, 0.2)
        """By how much it answers less at its edges [1]."""
        self.warming = rng.uniform(-0.06, 0.06)
        """Change of all answers over the session [1]."""
        self.drift = rng.normal(0.0, 60.0) + rng.normal(0.0, 20.0, len(self.centers))
        """Change of the idle readings over the session [counts]."""
        self.gain = rng.normal(1.0, 0.08, len(self.centers))
        """Gain of each channel [1]."""

    def counts(self, tip, indenter, number, period, rng):
        """Return readings [counts], shape (n, taxels), of a tip [mm, sensor frame], shape (n, 3), every period [s]."""
        _, wide, strong = INDENTERS[indenter]
        depth, done = np.maximum(tip[:, 2], 0.0), number / self.presses
        apart = np.linalg.norm(self.centers[None] - tip[:, None, :2], axis=-1)
        width = wide * (self.width + self.widening * depth)[:, None]
        answer = (depth**self.exponent)[:, None] * np.exp(-(apart**2) / (2 * width**2))
        late = np.exp(-period / self.lasting)
        answer = (1 - self.creep) * answer + self.creep * lfilter([1 - late], [1, -late], answer, axis=0)
        thin = 1 - self.edge * np.max((self.centers / self.half) ** 2, axis=1)
        strength = SLOPE * strong * (1 + self.warming * done) * self.gain * thin
        return np.round(OFFSET + self.drift * done + strength * answer + rng.normal(0.0, NOISE, answer.shape))
