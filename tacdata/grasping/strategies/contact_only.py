"""Contact only: any valid contact counts as central, and the object is lifted at once (paper, Exp. 3)."""

from __future__ import annotations

import numpy as np

from tacdata.grasping.centre import touched
from tacdata.grasping.strategies.strategy import Strategy


class ContactOnly(Strategy):
    """Uses whether there is contact, not where."""

    adjusts = False

    def centre(self, frames: np.ndarray) -> np.ndarray | None:
        """Return the pad's middle for any contact."""
        return np.zeros(2) if touched(frames) else None
