"""A power of depth: any transducer of a power on any contact of a power."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.laws.law import ContactLaw


class PowerLaw(ContactLaw):
    """A power of depth: any transducer of a power on any contact of a power."""

    title = "a power of depth"
    source = "self-similar contact: Johnson, Contact Mechanics, sec. 5.3"
    shapes = (0.5, 0.7, 0.85, 1.15, 1.3, 1.7, 2.0, 2.5, 3.0)

    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1]; the shape is the power [1]."""
        return depth**shape

    def said(self, shape: float) -> str:
        """Return the law with its number, in words."""
        return f"depth to the power {shape:g}"
