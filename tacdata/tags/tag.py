"""One AprilTag seen in an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag of the family 36h11."""

    id: int
    """Number in the family."""
    corners: np.ndarray
    """Corners of the black square [px], shape (4, 2), in AprilTag's order; integers at pixel centres."""
    margin: float
    """Contrast between the bits and their thresholds [1 of 255]; below about 20 a tag is doubtful."""
    hamming: int
    """Bits corrected."""

    @property
    def size(self) -> float:
        """Longest side [px]."""
        return float(np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=0), axis=1).max())
