"""Raw taxels: the centroid of the readings, each over the largest (paper, Exp. 3)."""

from __future__ import annotations

import numpy as np

from tacdata.grasping.centre import raw_centre
from tacdata.grasping.strategies.strategy import Strategy


class RawTaxel(Strategy):
    """Uses the taxels' readings."""

    def centre(self, frames: np.ndarray) -> np.ndarray | None:
        """Return the centroid of the averaged readings."""
        return raw_centre(frames, self.sensor)
