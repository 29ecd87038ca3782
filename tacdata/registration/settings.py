"""How far and how carefully a sensor is touched."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RegistrationSettings:
    """How far and how carefully."""

    above: float = 1.0
    """Height above the expected skin from which the first search begins [mm]."""
    limit: float = 1.0
    """How far below the expected skin the indenter may search [mm]."""
    depth: float = 0.4
    """Depth of the presses of the cross scan [mm]."""
    repeats: int = 2
    """Slow approaches at each place."""
    taxels: tuple[int, ...] = ()
    """Taxels of the cross scan; none: three that lie apart, away from the rim where there is room."""
    most_tilt: float = 3.0
    """Tilt that is still accepted [deg]."""
    flatness: float = 0.05
    """How far the touches may lie off their plane [mm]."""
    tolerance: float = 0.02
    """Largest uncertainty of the height that is accepted [mm]."""
