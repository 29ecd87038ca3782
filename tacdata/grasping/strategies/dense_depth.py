"""Dense depth: the centroid of the pixels deeper than 0.4 mm in the network's map (paper, Exp. 3)."""

from __future__ import annotations

import numpy as np

from tacdata.grasping.centre import dense_centre
from tacdata.grasping.strategies.strategy import Strategy


class DenseDepth(Strategy):
    """Uses the trained network's map."""

    def centre(self, frames: np.ndarray) -> np.ndarray | None:
        """Return the centroid of the averaged map's deep pixels."""
        return dense_centre(frames, self.sensor, self.maps)
