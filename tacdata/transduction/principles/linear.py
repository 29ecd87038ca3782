"""Capacitance in proportion to force and closure: the baseline for comparisons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.transduction.loads import Loads
from tacdata.transduction.principles.principle import Number, Principle


@dataclass(frozen=True)
class Linear(Principle):
    """C = C_rest + a force + b closure."""

    rest: Number = 1.0
    """Capacitance without load [pF]."""
    per_newton: Number = 1.0
    """a [pF/N]."""
    per_millimetre: Number = 0.0
    """b [pF/mm]."""

    def capacitance(self, loads: Loads) -> np.ndarray:
        """Return the capacitance [pF], shape (n, taxels)."""
        return self.rest + self.per_newton * loads.force + self.per_millimetre * loads.closure

    def derivatives(self, loads: Loads) -> Loads:
        """Return a, b and 0."""
        none = np.zeros_like(loads.force)
        return Loads(none + self.per_newton, none + self.per_millimetre, none)

    def saturated(self, loads: Loads) -> np.ndarray:
        """Return False everywhere."""
        return np.zeros(np.shape(loads.force), dtype=bool)

    def inverse(self, capacitance: np.ndarray, area: np.ndarray) -> Loads:
        """Return the force if only force counts, the closure if only closure counts, else NaN."""
        change, nothing = capacitance - self.rest, np.full(np.shape(capacitance), np.nan)
        a = np.broadcast_to(np.asarray(self.per_newton, dtype=float), nothing.shape)
        b = np.broadcast_to(np.asarray(self.per_millimetre, dtype=float), nothing.shape)
        force = np.divide(change, a, out=nothing.copy(), where=(a != 0) & (b == 0))
        closure = np.divide(change, b, out=nothing.copy(), where=(b != 0) & (a == 0))
        return Loads(force, closure, nothing)
