"""Tetrahedra of a slab with protrusions to the skin's mesh: on the true faces, quadratic, its faces named."""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.bending import bend
from tacdata.skin.mesh.generation.curving import curve
from tacdata.skin.mesh.generation.protrusion import Protrusion
from tacdata.skin.mesh.generation.snapping import SNAP, snap
from tacdata.skin.mesh.generation.topology import oriented, volumes, with_middles
from tacdata.skin.mesh.skin_mesh import SkinMesh

_VOLUME = 0.03
"""Share of the skin's volume that a mesh may lose or gain; coarse protrusions lose 1 % of a small skin [1]."""

_ON = 1e-9
"""Distance within which a node is on a plane [mm]."""


def quadratic(sensor: Sensor, vertices: np.ndarray, tets: np.ndarray) -> SkinMesh:
    """Snap the surface to the true faces, add mid-side nodes, name the parts of the surface, and bend a curved pad.

    Args:
        sensor: Whose skin it is.
        vertices: Corner positions [mm], shape (v, 3).
        tets: Corners of each tetrahedron, shape (e, 4).

    Raises:
        SolveError: If an element cannot be kept right side out.
    """
    skin = sensor.skin
    snapped = snap(sensor, *oriented(vertices, tets))
    _check_volume(sensor, float(volumes(snapped.vertices, snapped.tets).sum()))
    body = with_middles(snapped.vertices, snapped.tets)
    faces, taxel = snapped.faces, snapped.taxel
    z = snapped.vertices[faces][:, :, 2]
    # A face of the underside may have all corners on one rim; it is flat on z = 0.
    is_bump = np.all(taxel[faces] >= 0, axis=1) & ~np.all(np.abs(z) < _ON, axis=1)
    outer = body.triangles(faces[np.all(np.abs(z - skin.thickness) < _ON, axis=1)])
    bumps = body.triangles(faces[is_bump])
    bump_taxel = taxel[faces[is_bump]].max(axis=1).astype(np.int32)
    nodes = _round(sensor, body.nodes, body.tets, bumps, bump_taxel)
    inset = np.abs(np.abs(nodes[:, :2]) - [skin.size_x / 2, skin.size_y / 2])
    sides = (inset.min(axis=1) < _ON) & (nodes[:, 2] > -_ON)
    bottom = np.zeros(len(nodes), dtype=bool)
    bottom[body.triangles(faces[np.all(np.abs(z) < _ON, axis=1)]).ravel()] = True
    # Bend last: snapping and naming compare with the planes of the flat pad.
    return SkinMesh(bend(skin, nodes), body.tets, outer, bumps, bump_taxel, sides, bottom)


def _flat_volume(sensor: Sensor) -> float:
    """Return the volume of slab and protrusions before a pad is bent [mm^3]."""
    skin = sensor.skin
    slab = skin.size_x * skin.size_y * skin.thickness
    return slab + (sensor.taxels.count * Protrusion.of(skin).volume if skin.protrusion_radius else 0.0)


def _check_volume(sensor: Sensor, volume: float) -> None:
    """Refuse a mesh that lost part of the skin; ``volume`` is its volume by corners [mm^3]."""
    true = _flat_volume(sensor)
    if abs(volume - true) > _VOLUME * true:
        raise SolveError(
            f"the mesh holds {volume:.3g} mm^3, the skin {true:.3g} mm^3: faces closer than {SNAP:g} mm collapsed",
            f"a volume within {100 * _VOLUME:g} %",
            f"check the skin's sizes (all above {2 * SNAP:g} mm), or choose a smaller element size",
        )


def _round(sensor: Sensor, nodes: np.ndarray, tets: np.ndarray, bumps: np.ndarray, taxel: np.ndarray) -> np.ndarray:
    """Put mid-side nodes of protrusion faces on the true protrusion where the element allows it."""
    if not len(bumps):
        return nodes
    targets = nodes.copy()
    center = np.concatenate([sensor.taxels.centers[taxel], np.zeros((len(taxel), 1))], axis=1)
    for k in range(3, 6):
        targets[bumps[:, k]] = center + Protrusion.of(sensor.skin).project(nodes[bumps[:, k]] - center)
    return curve(nodes, targets, tets)
