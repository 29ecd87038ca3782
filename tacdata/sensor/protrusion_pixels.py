"""The pixels on which the pressure of each protrusion on the board is mapped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PIXELS = 10
"""Pixels along each side."""


@dataclass(frozen=True)
class ProtrusionPixels:
    """Square pixels around the undeformed centre of a protrusion, seen from above: [i, j] has i along x, j along y."""

    radius: float
    """Of the protrusions [mm]; pixels reach a quarter of it beyond them."""

    @property
    def pitch(self) -> float:
        """Side of a pixel [mm]."""
        return self.radius / 4

    @property
    def offsets(self) -> np.ndarray:
        """Pixel centres along either side, from the protrusion's centre [mm], shape (PIXELS,)."""
        return self.pitch * (np.arange(PIXELS) - (PIXELS - 1) / 2)
