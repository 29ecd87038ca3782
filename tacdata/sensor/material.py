"""The skin's material: elastic constants, hyperelastic law, relaxation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

from tacdata.errors import FormatError


@dataclass(frozen=True)
class PronyTerm:
    """One term of a Prony series: G(t) = G0 (1 - sum_i g_i (1 - exp(-t / tau_i)))."""

    share: float
    """Share g of the instantaneous shear modulus that relaxes [1]."""
    time: float
    """Relaxation time tau [s]."""


@dataclass(frozen=True)
class Material:
    """Long-term elastic constants, hyperelastic law and relaxation of the skin."""

    law: str
    """File name in tacdata/skin/materials."""
    youngs_modulus: float
    """Young's modulus E [MPa], long-term."""
    poisson_ratio: float
    """Poisson's ratio nu [1], long-term."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """The law's own parameters, by name. Missing ones keep their default, at which the law is Neo-Hookean."""
    prony: tuple[PronyTerm, ...] = ()
    """Relaxation of the isochoric part; empty for an elastic skin."""

    @property
    def shear_modulus(self) -> float:
        """Shear modulus mu = E / 2(1 + nu) [MPa], long-term."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus kappa = E / 3(1 - 2 nu) [MPa]; it does not relax."""
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))

    @property
    def document(self) -> dict[str, Any]:
        """The material as its part of the sensor file.

        What a file leaves out stays out, so that a sensor's hash survives additions to the format.
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
        if self.prony:
            document["prony"] = [{"share": term.share, "time": term.time} for term in self.prony]
        return document

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> Self:
        """Build a material from its part of a checked sensor file; ``origin`` names the file in errors.

        Raises:
            FormatError: If the Prony series leaves no long-term modulus or has a relaxation time twice.
        """
        values = dict(document)
        terms = tuple(PronyTerm(**term) for term in values.pop("prony", ()))
        times = [term.time for term in terms]
        total = sum(term.share for term in terms)
        if total >= 1:
            raise FormatError(
                f"{origin}: material/prony: the shares add up to {total:g}, so that nothing is left at rest",
                "shares of the instantaneous modulus with a sum below 1",
                "reduce the shares",
            )
        if len(set(times)) < len(times):
            raise FormatError(
                f"{origin}: material/prony: the relaxation times {times} s are not all different",
                "one term for each relaxation time",
                "add the shares of terms with the same time",
            )
        return cls(prony=terms, **values)
