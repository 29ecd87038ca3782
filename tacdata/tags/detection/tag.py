"""One AprilTag seen in an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class Tag:
    """A detected tag of the family 36h11."""

    id: int
    """Number in the family."""
    corners: np.ndarray
    """Corners of the black square [px], shape (4, 2), in AprilTag's order; integers at pixel centres."""
    margin: float
    """Contrast between the bits and their thresholds [1 of 255]; below about 20 a tag is unreliable."""
    hamming: int
    """Bits corrected."""

    @cached_property
    def size(self) -> float:
        """Longest side [px]."""
        sides = self.corners - self.corners[[3, 0, 1, 2]]
        return float(np.sqrt(np.square(sides).sum(axis=1).max()))
