"""Whether the mesh under a press is fine enough for the indenter's sharpest edge."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.skin.mesh import SkinMesh
from tacdata.skin.press import PressRequest
from tacdata.skin.touch import reach

_SPACING = 1 / 3
"""Distance of the contact's quadrature points over the edge of their triangle [1]."""


def edge_under(mesh: SkinMesh, sensor: Sensor, request: PressRequest) -> float:
    """Return the median edge of the outer face's triangles that a press may touch, or of the nearest [mm]."""
    corners = mesh.nodes[mesh.outer[:, :3]]
    offset = np.abs(corners.mean(axis=1)[:, :2] - [request.x, request.y])
    near = np.all(offset <= reach(sensor, request), axis=1)
    if not near.any():
        near = np.arange(len(offset)) == np.hypot(*offset.T).argmin()
    sides = corners[near] - np.roll(corners[near], 1, axis=1)
    return float(np.median(np.linalg.norm(sides, axis=-1)))


def remark(mesh: SkinMesh, sensor: Sensor, request: PressRequest) -> str:
    """Return in words that an edge is finer than the mesh can see; empty if none is."""
    if not max(request.depths) > 0:
        return ""
    edge, sharpest = edge_under(mesh, sensor, request), request.indenter.sharpest
    if sharpest >= _SPACING * edge:
        return ""
    return (
        f"{request.indenter.shape}: its sharpest radius is {sharpest:.2g} mm, and contact is seen at points "
        f"{_SPACING * edge:.2g} mm apart (triangles of {edge:.2g} mm): force and map near that edge may be off beyond "
        f"the numerical error; triangles of {sharpest / _SPACING:.2g} mm would see it"
    )
