"""Soft sensors as other labs build them: each channel's reading as a function of depth, without any history."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Skin:
    """One sensor's law."""

    channels: int
    rate: float
    """Readings a second [Hz]."""
    steep: tuple
    """Least and largest exponent of a channel's rise with depth."""
    levels: float
    """Size of one count over the largest rise [1]."""

    def laws(self, rng, sites):
        """Return a function from site, depth [mm] and largest depth to loads, shape (n, channels)."""
        power = rng.uniform(*self.steep, size=(sites, self.channels))
        share = rng.uniform(0.25, 1.0, size=(sites, self.channels))
        share *= rng.choice([1.0, 1.0, -0.4], (sites, self.channels))
        bend = rng.uniform(0.0, 0.5, size=(sites, self.channels))

        def loads(site, depth, deepest):
            part = np.maximum(depth, 0.0)[:, None] / deepest
            return share[site] * part ** power[site] * (1 + bend[site] * part) / (1 + bend[site])

        return loads


SKINS = {
    "capacitive pad": Skin(1, 100.0, (1.3, 1.8), 2e-4),
    "capacitive array": Skin(16, 50.0, (1.2, 2.0), 1e-3),
    "magnetic skin": Skin(15, 80.0, (1.0, 1.6), 1e-4),
    "resistive mat": Skin(6, 30.0, (0.7, 1.2), 2e-3),
}
