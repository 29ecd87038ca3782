"""How fine a mesh is to be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshSettings:
    """Target edge lengths [mm].

    The default ones give some 10,200 nodes. Solutions then differ from independent ones by 1 % in force, and by 5 % of
    the largest in each protrusion's force (`tests/skin/model/test_skin_reference.py`, decision 0019).

    Example:
        >>> from tacdata.skin.mesh.generation.settings import MeshSettings
        >>> coarse = MeshSettings(outer=1.2, tip=None)
        >>> coarse.interior  # mm
        2.4
    """

    outer: float = 0.6
    """At the outer face [mm]."""
    interior: float = 2.4
    """In the middle of the slab [mm]."""
    protrusion: float = 1.2
    """At the protrusions [mm]."""
    tip: float | None = 0.3
    """At the protrusions' tips [mm]; None: one ring of edges around the contact patch."""
    envelope: float = 1e-3
    """fTetWild's envelope over the bounding box's diagonal [1]."""
    focus: tuple[float, ...] | None = None
    """A disc of the outer face to refine: x, y, radius, edge length [mm].

    A fifth number leaves out a disc of that radius in its middle: a punch is sharp at its edge alone."""
