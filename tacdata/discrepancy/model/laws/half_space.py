"""Elastic half space under a sphere."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw


class HalfSpace(ContactLaw):
    """Elastic half space under a sphere."""

    title = "a half space under a sphere (Hertz: depth to the power 1.5)"
    source = "Johnson, Contact Mechanics, eq. 4.23"

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1], shape as the depth."""
        return depth**1.5
