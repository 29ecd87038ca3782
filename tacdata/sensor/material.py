"""The skin's material: elastic constants and hyperelastic law."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self


@dataclass(frozen=True)
class Material:
    """Elastic constants and hyperelastic law of the skin, at rest."""

    law: str
    """File name in tacdata/skin/materials."""
    youngs_modulus: float
    """Young's modulus E [MPa]."""
    poisson_ratio: float
    """Poisson's ratio nu [1]."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """The law's own parameters, by name. Missing ones keep their default, at which the law is Neo-Hookean."""

    @property
    def shear_modulus(self) -> float:
        """Shear modulus mu = E / 2(1 + nu) [MPa]."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus kappa = E / 3(1 - 2 nu) [MPa]."""
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))

    @property
    def document(self) -> dict[str, Any]:
        """The material as its part of the sensor file.

        Omitted entries stay omitted, so that a sensor's hash survives additions to the format.
        """
        document: dict[str, Any] = {
            "law": self.law,
            "youngs_modulus": self.youngs_modulus,
            "poisson_ratio": self.poisson_ratio,
        }
        if self.parameters:
            document["parameters"] = {
                name: list(value) if isinstance(value, tuple) else value for name, value in self.parameters.items()
            }
        return document

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> Self:
        """Build a material from its part of a checked sensor file; ``origin`` names the file in errors."""
        return cls(**document)
