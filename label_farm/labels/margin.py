"""The uncertainty of a label in three numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tacdata.labels import Label


@dataclass(frozen=True)
class Margin:
    """Errors and uncertainty of one label over the pixels in contact."""

    numerical: float
    """Median of the estimated numerical error [mm]."""
    between: float
    """Largest error of a state if left out, at its worst pixel [mm]."""
    uncertainty: float | None
    """Median standard deviation by the sensor file's spreads [mm]; None if the label knows of none."""

    @classmethod
    def of(cls, label: Label) -> Self | None:
        """Return a label's margin; None if no pixel is in contact."""
        dented = label.dented
        if not dented.any():
            return None
        between = 0.0 if label.interpolation_error is None else float(label.interpolation_error.max())
        spread = None if label.uncertainty is None else float(np.median(label.uncertainty[dented].astype(float)))
        return cls(float(np.median(label.error_map[dented].astype(float))), between, spread)
