"""Loads on the protrusions: force, closure, contact area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import FormatError


@dataclass(frozen=True)
class Loads:
    """Force, closure and contact area of n states; also used for one value of each, such as derivatives."""

    force: np.ndarray
    """Normal force on each protrusion [N], shape (n, taxels); pressing is positive."""
    closure: np.ndarray
    """Closure of the gap over each taxel [mm], shape (n, taxels)."""
    area: np.ndarray
    """Contact area of each protrusion with the board [mm^2], shape (n, taxels)."""

    def check(self, taxels: int) -> None:
        """Refuse loads that are not of (n, ``taxels``) finite numbers.

        Raises:
            FormatError: Naming the wrong load.
        """
        for name in ("force", "closure", "area"):
            values = np.asarray(getattr(self, name))
            if values.ndim != 2 or values.shape[1] != taxels or values.shape != np.shape(self.force):
                raise FormatError(
                    f"loads: {name} has the shape {values.shape}",
                    f"(n, {taxels}), the same for force, closure and area",
                    "give one row per state, one column per taxel",
                )
            if not np.isfinite(values).all():
                row, column = np.argwhere(~np.isfinite(values))[0]
                raise FormatError(
                    f"loads: {name} of taxel {column} in state {row} is {values[row, column]}",
                    "finite numbers",
                    "a solve that failed has no loads: leave its states out",
                )
