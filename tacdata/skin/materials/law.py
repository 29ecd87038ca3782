"""What a material law's file holds.

``tacdata/skin/materials/my_law.py`` defines one class derived from `Law`. A sensor or case file names it by its file's
name. Both Warp functions take the law's parameters as ``wp.types.vector(8, wp.float64)``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from tacdata import registry
from tacdata.sensor import Material

if TYPE_CHECKING:
    import warp as wp

ROOM, BASE = "tacdata.skin.materials", "law"


class Law(ABC):
    """A strain energy density W(F), isotropic, with W = 0 and P = 0 at F = I."""

    @abstractmethod
    def parameters(self, material: Material) -> tuple[float, ...]:
        """Return at most 8 numbers for the functions below, from the elastic constants [MPa, 1]."""

    @abstractmethod
    def energy_function(self) -> wp.Function:
        """Return ``f(F: wp.mat33d, m: Parameters) -> wp.float64``: energy per undeformed volume [N/mm^2 = MPa]."""

    @abstractmethod
    def stress_function(self) -> wp.Function:
        """Return ``f(F, m) -> wp.mat33d``: first Piola-Kirchhoff stress P = dW/dF [MPa]."""

    @abstractmethod
    def tangent_function(self) -> wp.Function:
        """Return ``f(F, dF, m) -> wp.mat33d``: directional derivative of P along dF [MPa]."""


def load_law(name: str) -> Law:
    """Return the law called ``name``.

    Raises:
        UsageError: If there is no such file.
    """
    kind: type[Law] = registry.load(ROOM, BASE, name, Law)
    return kind()
