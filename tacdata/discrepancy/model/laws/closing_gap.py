"""A capacitor whose gap closes with depth."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw, between


class ClosingGap(ContactLaw):
    """A capacitor whose gap closes with depth."""

    title = "a gap that closes (parallel plates)"
    source = "parallel plates: C = eps A / g"
    shapes = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1]; the shape is how much of the gap the deepest press closes [1]."""
        return depth / (1 - shape * depth)

    def said(self, smallest: float, largest: float) -> str:
        """Return the law with its number, in words."""
        return f"{self.title}, by {between(100 * smallest, 100 * largest)} % at the deepest"
