"""Whether the mesh under a press is fine enough for the indenter's sharpest edge, and for adhesion."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.press import PressRequest

_SPACING = 1 / 2
"""Distance of the nodes, whose hats close a gap in the mean, over the edge of their triangle [1]."""


def edge_under(mesh: SkinMesh, request: PressRequest, reach: tuple[float, float]) -> float:
    """Return the median edge of the outer face's triangles that a press may touch, or of the nearest [mm].

    Args:
        mesh: The mesh.
        request: The press.
        reach: Half widths of its contact at the deepest state [mm].
    """
    corners = mesh.nodes[mesh.outer[:, :3]]
    offset = np.abs(corners.mean(axis=1)[:, :2] - [request.x, request.y])
    near = np.all(offset <= reach, axis=1)
    if not near.any():
        near = np.arange(len(offset)) == np.hypot(*offset.T).argmin()
    sides = corners[near] - np.roll(corners[near], 1, axis=1)
    return float(np.median(np.linalg.norm(sides, axis=-1)))


def remark(mesh: SkinMesh, sensor: Sensor, request: PressRequest, reach: tuple[float, float]) -> str:
    """Return a remark on shapes finer than the mesh resolves, empty if there are none; ``reach`` as of `edge_under`."""
    if not max(request.depths) > 0:
        return ""
    edge = edge_under(mesh, request, reach)
    return "; ".join(filter(None, (_edge_remark(edge, request), _adhesion_remark(edge, sensor))))


def _edge_remark(edge: float, request: PressRequest) -> str:
    sharpest = request.indenter.sharpest
    if sharpest >= _SPACING * edge:
        return ""
    return (
        f"{request.indenter.shape}: its sharpest radius is {sharpest:.2g} mm, and contact is seen at nodes "
        f"{_SPACING * edge:.2g} mm apart (triangles of {edge:.2g} mm): force and map near that edge may be off beyond "
        f"the numerical error; triangles of {sharpest / _SPACING:.2g} mm would see it"
    )


def _adhesion_remark(edge: float, sensor: Sensor) -> str:
    adhesion, material = sensor.contact.adhesion, sensor.material
    if adhesion is None:
        return ""
    # Length over which traction falls at the contact's edge (Hillerborg, Cem. Concr. Res. 6 (1976) 773): E' w / t^2.
    plane = material.youngs_modulus / (1 - material.poisson_ratio**2)
    # Work is in J/m^2, which is 1e-3 N/mm.
    width = plane * adhesion.range**2 / (adhesion.work * 1e-3)
    if width >= _SPACING * edge:
        return ""
    return (
        f"adhesion: traction falls over {width:.2g} mm at the contact's edge, and is seen at nodes "
        f"{_SPACING * edge:.2g} mm apart (triangles of {edge:.2g} mm): the skin lets go too late, at too large a "
        f"force; triangles of {width / _SPACING:.2g} mm, or a range of "
        f"{np.sqrt(_SPACING * edge * adhesion.work * 1e-3 / plane):.2g} mm, would do"
    )
