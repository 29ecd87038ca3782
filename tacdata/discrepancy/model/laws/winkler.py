"""Winkler foundation: springs side by side."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw


class Winkler(ContactLaw):
    """Winkler foundation: springs side by side."""

    title = "a Winkler foundation (reading in proportion to depth)"
    source = "Johnson, Contact Mechanics, sec. 4.3"

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1], shape as the depth."""
        return depth
