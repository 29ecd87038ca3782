"""Shapes that miss the skin, or touch it off their own axis: reported before a press is recorded or solved."""

from __future__ import annotations

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.indenters import Indenter
from tacdata.indenters.mesh import Mesh

_LEVEL = 0.02
"""Vertices within this height above the lowest one [mm] belong to the tip."""
_ASIDE = 0.1
"""A tip farther than this from the axis [mm], and than this share of the extent, is reported."""


def check_touch(
    indenter: Indenter, size: tuple[float, float], place: tuple[float, float], yaw: float, depth: float, origin: str
) -> None:
    """Refuse an upright shape that touches no part of a flat skin.

    Args:
        indenter: The shape.
        size: The skin's extent along x and y [mm].
        place: x and y of the press [mm], on the skin.
        yaw: Angle by which the shape is turned [deg].
        depth: Depth of its lowest point below the face [mm], above 0.
        origin: Names the press in errors.

    Raises:
        FormatError: If nothing of the shape that is so low is over the skin.
    """
    try:
        if indenter.profile(*np.zeros((2, 1)))[0] <= depth:
            return  # over its axis, as most shapes do
    except UsageError:
        return  # of a session whose surface file is on another machine
    reach = indenter.extent
    # The part of the shape's own square that lies over the skin.
    spans = [np.linspace(max(-s / 2 - c, -reach), min(s / 2 - c, reach), 129) for s, c in zip(size, place, strict=True)]
    x, y = (axis.ravel() for axis in np.meshgrid(*spans, indexing="ij"))
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    if indenter.profile(c * x + s * y, c * y - s * x).min() <= depth:
        return
    x, y = np.meshgrid(*2 * [np.linspace(-reach, reach, 129)])
    # How far from its axis the shape is that low anywhere: for the error.
    aside = np.hypot(x, y)[indenter.profile(x, y) <= depth].min(initial=reach)
    raise FormatError(
        f"{origin}: {indenter.shape} at ({place[0]:g}, {place[1]:g}) mm, {depth:g} mm deep, does not touch the skin of "
        f"{size[0]:g} x {size[1]:g} mm: its lowest part lies {aside:.3g} mm beside the press axis",
        "a shape whose lowest part meets the skin",
        "move its tip to x = y = 0 in its file, or move the press",
    )


def tip_aside(indenter: Indenter) -> str:
    """Return as a sentence where a solid from a file touches first, if that is off its axis; else ""."""
    if not isinstance(indenter, Mesh):
        return ""
    vertices = np.asarray(indenter.solid.mesh.vertices)
    tip = vertices[vertices[:, 2] < vertices[:, 2].min() + _LEVEL, :2]
    x, y = (tip.min(axis=0) + tip.max(axis=0)) / 2
    aside = float(np.hypot(x, y))
    if aside < max(_ASIDE, _ASIDE * indenter.extent):
        return ""
    return (
        f"{indenter.file} touches first at ({x:.3g}, {y:.3g}) mm, {aside:.3g} mm beside the press axis; "
        f"move it in the CAD file if that is not meant"
    )
