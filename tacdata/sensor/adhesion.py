"""Adhesion between the skin and an indenter."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Adhesion:
    """Adhesion between indenter and outer face."""

    law: str
    """File name in tacdata/skin/adhesions: traction as a function of the gap."""
    work: float
    """Work of adhesion w per unit of area [J/m^2 = N/m]."""
    range: float
    """Length scale of the gap in the law [mm]."""

    @property
    def document(self) -> dict[str, Any]:
        """The adhesion as its part of the sensor's document."""
        return asdict(self)
