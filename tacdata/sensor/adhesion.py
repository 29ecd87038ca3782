"""How the skin sticks to what presses it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Adhesion:
    """Attraction between indenter and outer face."""

    law: str
    """File name in tacdata/skin/adhesions: how traction falls with the gap."""
    work: float
    """Work of adhesion w: what it costs to part a unit of area [J/m^2 = N/m]."""
    range: float
    """Length that scales the gap in the law [mm]."""

    @property
    def document(self) -> dict[str, Any]:
        """The adhesion as its part of the sensor's document."""
        return asdict(self)
