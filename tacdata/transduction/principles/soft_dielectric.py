"""A soft layer between the plates that a protrusion squeezes: the reading follows pressure, so force and area.

The layer yields under the loaded part A_l of the electrode by the strain force / (A_l E_d); the rest keeps its
thickness. Plates in parallel: C = eps0 eps / d0 (A + A_l strain / (1 - strain)) + C_p.

A_l is the disc of the contact area, its radius enlarged by ``spread`` layer thicknesses, at most the electrode. With a
wide spread A_l is the electrode: C = eps0 eps A / (d0 (1 - p / E_d)) + C_p with p = force / A.

The layer's own deformation is neglected against the protrusion's: it does not move the board.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.transduction.loads import Loads
from tacdata.transduction.principles.principle import PERMITTIVITY, Number, Principle


@dataclass(frozen=True)
class SoftDielectric(Principle):
    """C = eps0 eps / d0 (A + A_l strain / (1 - strain)) + C_p with strain = force / (A_l E_d)."""

    electrode_area: Number = 3.0
    """A [mm^2]."""
    thickness: Number = 0.2
    """d0 of the layer without load [mm]."""
    permittivity: Number = 3.0
    """eps relative to vacuum [1]."""
    modulus: Number = 0.2
    """E_d: pressure over strain of the layer [MPa]."""
    spread: Number = 1e3
    """Widening of the contact's radius through the layer, over d0 [1]; large for the whole electrode."""
    parasitic: Number = 1.0
    """C_p of traces and fringes [pF]."""
    largest_strain: Number = 0.9
    """Strain at which the layer is crushed and stops yielding [1]."""

    def complaint(self) -> str:
        """Return the fault of the parameters."""
        if words := self.not_positive("electrode_area", "thickness", "permittivity", "modulus", "largest_strain"):
            return words
        if np.max(self.largest_strain) >= 1:
            return f"largest_strain = {np.max(self.largest_strain):g}; allowed is below 1"
        wrong = [name for name in ("spread", "parasitic") if np.min(getattr(self, name)) < 0]
        return f"{' and '.join(wrong)} below 0; allowed is 0 or more" if wrong else ""

    def capacitance(self, loads: Loads) -> np.ndarray:
        """Return the capacitance [pF], shape (n, taxels)."""
        area, _ = self._loaded(loads.area)
        strain = np.minimum(self._strain(loads), self.largest_strain)
        return self._scale * (self.electrode_area + area * strain / (1 - strain)) + self.parasitic

    def derivatives(self, loads: Loads) -> Loads:
        """Return the derivatives; that of force is 0 where the layer is crushed."""
        _, slope = self._loaded(loads.area)
        strain, crushed = self._strain(loads), self.saturated(loads)
        bounded = np.minimum(strain, self.largest_strain)
        per_force = np.where(crushed, 0.0, self._scale / self.modulus / (1 - bounded) ** 2)
        per_area = np.where(crushed, bounded / (1 - bounded), -((bounded / (1 - bounded)) ** 2)) * self._scale * slope
        return Loads(per_force, np.zeros(np.shape(loads.force)), per_area)

    def saturated(self, loads: Loads) -> np.ndarray:
        """Return where the layer is crushed, shape (n, taxels), bool."""
        return np.asarray(self._strain(loads) >= self.largest_strain)

    def inverse(self, capacitance: np.ndarray, area: np.ndarray) -> Loads:
        """Return the force for a contact area; NaN where the layer is crushed."""
        loaded, _ = self._loaded(area)
        nothing = np.full(np.shape(capacitance), np.nan)
        # strain / (1 - strain)
        squeeze = ((capacitance - self.parasitic) / self._scale - self.electrode_area) / loaded
        strain = np.divide(squeeze, 1 + squeeze, out=nothing.copy(), where=squeeze > -1)
        force = np.where(strain < self.largest_strain, strain * loaded * self.modulus, np.nan)
        return Loads(force, nothing, nothing)

    @property
    def _scale(self) -> Number:
        """eps0 eps / d0 [pF/mm^2]."""
        return PERMITTIVITY * self.permittivity / self.thickness

    def _strain(self, loads: Loads) -> np.ndarray:
        area, _ = self._loaded(loads.area)
        return loads.force / (area * self.modulus)

    def _loaded(self, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the loaded area [mm^2] and its derivative with respect to the contact area [1]."""
        radius = np.sqrt(np.maximum(area, 1e-6) / np.pi)
        wide = np.pi * (radius + self.spread * self.thickness) ** 2
        slope = np.where(np.asarray(area) > 1e-6, (radius + self.spread * self.thickness) / radius, 0.0)
        covered = wide >= self.electrode_area
        return np.where(covered, self.electrode_area, wide), np.where(covered, 0.0, slope)
