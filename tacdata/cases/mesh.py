"""The mesh for one press: fine where it touches, as many elements elsewhere as the far field needs."""

from __future__ import annotations

import numpy as np

from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.settings import MeshSettings
from tacdata.skin.press import PressRequest

_OUTER, _INTERIOR = 0.8, 1.4
"""Edge lengths away from the press [mm]."""

_PROTRUSION, _TIP = 1.15, 0.24
"""Edge lengths at a protrusion and at its tip over its radius [1]: measured, tips of 0.3 bear a tenth too much."""

_FINEST, _COARSEST = 0.15, 0.4
"""Bounds of the edge length under the press [mm]."""

_FEATURE, _ALLOWANCE = 0.15, 0.12
"""The edge length under the press is this share of the indenter's smallest radius of curvature, plus this [mm]. That is
about a third of a sphere's contact radius at a depth of a twentieth of its radius."""

_MARGIN = 0.4
"""How far beyond the contact the mesh stays fine [mm]."""

_RIM, _EVEN = 0.4, 1e-6
"""Width inside a punch's fillet that stays fine, and height within which its face is flat [mm]."""

_TOUCHED = 0.6
"""Share of the depth to which the skin follows a shape upward: half on a sphere (Hertz)."""


def _flat(indenter: Indenter) -> float:
    """Return the radius of the largest disc about the tip that is flat [mm]: under a punch only its edge is sharp."""
    radius = np.linspace(0, indenter.extent, 129)
    turn = np.linspace(0, 2 * np.pi, 65)[:, None]
    flat = np.all(np.abs(indenter.profile(radius * np.cos(turn), radius * np.sin(turn))) < _EVEN, axis=0)
    return float(radius[max(int(flat.argmin()) - 1, 0)]) if not flat.all() else 0.0


def mesh_for(sensor: Sensor, request: PressRequest) -> MeshSettings:
    """Return mesh settings for a press: for one case, not for labels, which share one mesh."""
    fine = float(np.clip(_FEATURE * request.indenter.sharpest + _ALLOWANCE, _FINEST, _COARSEST))
    reach = max(request.indenter.footprint(_TOUCHED * max(request.depths), request.yaw), default=0.0)
    radius = sensor.skin.protrusion_radius
    focus = (request.x, request.y, round(reach + _MARGIN, 3), round(fine, 3))
    if (hole := _flat(request.indenter) - _RIM) > fine:
        focus = (*focus, round(hole, 3))
    return MeshSettings(
        outer=_OUTER,
        interior=_INTERIOR,
        focus=focus,
        **({"protrusion": round(_PROTRUSION * radius, 3), "tip": round(_TIP * radius, 3)} if radius else {}),
    )
