"""Two plates whose gap closes with the skin above the protrusion: the reading follows displacement, not force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.transduction.loads import Loads
from tacdata.transduction.principles.principle import PERMITTIVITY, Number, Principle


@dataclass(frozen=True)
class GapClosing(Principle):
    """C = eps0 eps A / (gap - share closure) + C_p; plates that meet stay apart by their insulation."""

    electrode_area: Number = 3.0
    """A [mm^2]."""
    gap: Number = 0.7
    """Distance of the plates without load [mm], insulation included."""
    permittivity: Number = 2.0
    """eps relative to vacuum [1], of air and silicone together."""
    parasitic: Number = 1.0
    """C_p of traces and fringes [pF]."""
    closure_share: Number = 1.0
    """Share of the closure by which the plates approach [1]."""
    insulation: Number = 0.02
    """Thickness that keeps the plates apart when they meet [mm]."""

    def complaint(self) -> str:
        """Return the fault of the parameters."""
        if words := self.not_positive("electrode_area", "gap", "permittivity", "closure_share", "insulation"):
            return words
        if np.any(np.asarray(self.insulation) >= self.gap):
            filled = f"insulation {np.max(self.insulation):g} mm fills the gap of {np.min(self.gap):g} mm"
            return f"{filled}; allowed is less"
        return "" if np.min(self.parasitic) >= 0 else f"parasitic = {np.min(self.parasitic):g}; allowed is 0 or more"

    def capacitance(self, loads: Loads) -> np.ndarray:
        """Return the capacitance [pF], shape (n, taxels)."""
        return self._scale / self._distance(loads.closure) + self.parasitic

    def derivatives(self, loads: Loads) -> Loads:
        """Return 0, share eps0 eps A / distance^2 (0 where the plates have met) and 0."""
        none = np.zeros(np.shape(loads.closure))
        slope = self.closure_share * self._scale / self._distance(loads.closure) ** 2
        return Loads(none, np.where(self.saturated(loads), 0.0, slope), none)

    def saturated(self, loads: Loads) -> np.ndarray:
        """Return where the plates have met, shape (n, taxels), bool."""
        return np.asarray(self.gap - self.closure_share * loads.closure <= self.insulation)

    def inverse(self, capacitance: np.ndarray, area: np.ndarray) -> Loads:
        """Return the closure; NaN where the plates have met or the parasitic capacitance alone is larger."""
        nothing = np.full(np.shape(capacitance), np.nan)
        plates = capacitance - self.parasitic
        within = (plates > 0) & (plates * self.insulation < self._scale)
        distance = np.divide(self._scale, plates, out=nothing.copy(), where=within)
        return Loads(nothing, (self.gap - distance) / self.closure_share, nothing)

    @property
    def _scale(self) -> Number:
        """eps0 eps A [pF mm]."""
        return PERMITTIVITY * self.permittivity * self.electrode_area

    def _distance(self, closure: np.ndarray) -> np.ndarray:
        return np.maximum(self.gap - self.closure_share * closure, self.insulation)
