"""Settings of the procedure: heights, depths, repeats and tolerances."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RegistrationSettings:
    """How far and how carefully a sensor is touched."""

    above: float = 1.0
    """Height above the expected skin from which the first search begins [mm]."""
    limit: float = 1.0
    """How far below the expected skin the indenter may go [mm]."""
    depth: float = 0.4
    """Depth of the presses of the cross scan [mm]."""
    repeats: int = 2
    """Slow approaches at each place."""
    taxels: tuple[int, ...] = ()
    """Taxels of the cross scan; if empty, three that lie apart, away from the rim where there is room."""
    most_tilt: float = 3.0
    """Largest accepted tilt [deg]."""
    flatness: float = 0.05
    """Largest accepted distance of a touch from the plane [mm]."""
    tolerance: float = 0.02
    """Largest accepted uncertainty of the height [mm]."""
