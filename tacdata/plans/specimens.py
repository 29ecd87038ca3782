"""Indenters that a lab can print, by their names in plans."""

from __future__ import annotations

from typing import Any

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.indenters.indenter import BASE, ROOM

STANDARD: dict[str, dict[str, Any]] = {
    "sphere_2": {"shape": "sphere", "radius": 2.0},
    "sphere_4": {"shape": "sphere", "radius": 4.0},
    "punch": {"shape": "flat_punch", "radius": 1.5, "edge_radius": 0.3},
    "pin": {"shape": "cylinder", "radius": 1.5, "length": 5.0, "edge_radius": 0.5},
    "ellipsoid": {"shape": "ellipsoid", "a": 3.0, "b": 1.8, "c": 2.0},
    "square": {"shape": "square_punch", "side": 2.5, "edge_radius": 0.3},
    "ring": {"shape": "ring", "ring_radius": 1.8, "tube_radius": 0.7},
    "cone": {"shape": "cone", "half_angle": 60.0, "tip_radius": 0.6, "radius": 2.5},
    "prism": {"shape": "prism", "angle": 120.0, "edge_radius": 0.5, "length": 5.0, "width": 4.0},
}
"""Specimens; lengths in mm, angles in deg."""


def specimens(names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Return the documents of specimens by their names in `STANDARD`.

    Raises:
        UsageError: If one is unknown, or none is named.
    """
    # A shape whose file was taken out of the folder is no longer offered.
    available = [name for name, shape in STANDARD.items() if shape["shape"] in registry.names(ROOM, BASE)]
    unknown = [name for name in names if name not in available]
    if unknown or not names:
        raise UsageError(
            f"indenter {', '.join(unknown) or 'none'}",
            ", ".join(available),
            "choose among them, or write a plan by hand",
        )
    return {name: dict(STANDARD[name]) for name in names}
