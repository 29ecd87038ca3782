"""Bonded layer that keeps its volume, under a sphere."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw, between

SERIES = (1.0, 1.133, 1.283, 0.769, 0.0975)
"""Coefficients of the powers of contact radius over thickness [1]."""


class BondedLayer(ContactLaw):
    """Bonded layer that keeps its volume, under a sphere."""

    title = "a bonded layer under a sphere"
    source = "Dimitriadis et al., Biophys. J. 82 (2002) 2798"
    shapes = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5)

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1]; the shape is the contact radius over the thickness at the deepest point [1]."""
        wide = shape * np.sqrt(depth)
        return depth**1.5 * sum(c * wide**k for k, c in enumerate(SERIES))

    def said(self, smallest: float, largest: float) -> str:
        """Return the law with its number, in words."""
        return (
            f"{self.title} (at the deepest, the contact's radius is {between(smallest, largest)} times its thickness)"
        )
