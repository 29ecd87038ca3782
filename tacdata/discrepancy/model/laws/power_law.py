"""A power of depth: any transducer of a power on any contact of a power."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw, between


class PowerLaw(ContactLaw):
    """A power of depth: any transducer of a power on any contact of a power."""

    title = "a power of depth"
    source = "self-similar contact: Johnson, Contact Mechanics, sec. 5.3"
    shapes = tuple(round(0.05 * k, 2) for k in range(10, 61))

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1]; the shape is the power [1]."""
        return depth**shape

    def said(self, smallest: float, largest: float) -> str:
        """Return the law with its number, in words."""
        return f"depth to the power {between(smallest, largest)}"
