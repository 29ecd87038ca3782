"""Surface vertices of a slab with protrusions, put on the true planes and protrusions that they belong to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.protrusion import Protrusion
from tacdata.skin.mesh.generation.topology import boundary, volumes

SNAP = 0.1
"""Distance within which a surface vertex belongs to a plane [mm]; above fTetWild's envelope."""

_SNAP_SPHERE = 0.25
"""The same for a protrusion, over its radius [1]; above the sagitta of its rings."""

_ROUNDS = 12
"""How often elements are mended at most; each round takes those that the one before left flat [1]."""

_SLIVER = 0.02
"""Share of its volume that an element must keep when its corners go to the true faces [1]."""


@dataclass(frozen=True)
class Snapped:
    """Tetrahedra with their surface on the true faces."""

    vertices: np.ndarray
    """Positions [mm], shape (v, 3)."""
    tets: np.ndarray
    """Tetrahedra, shape (e, 4), int32."""
    faces: np.ndarray
    """Triangles of the surface, normals outward, shape (f, 3), int32."""
    taxel: np.ndarray
    """Taxel whose protrusion has the vertex, or -1, shape (v,), int64."""


def snap(sensor: Sensor, vertices: np.ndarray, tets: np.ndarray) -> Snapped:
    """Put the surface on the true faces; elements that this flattens are mended or left out.

    Args:
        sensor: Whose skin it is.
        vertices: Positions [mm], shape (v, 3); inner ones may be moved.
        tets: Tetrahedra of positive volume, shape (e, 4).
    """
    for _ in range(_ROUNDS):
        faces = boundary(tets)
        surface = np.unique(faces)
        snapped, taxel = _on_faces(sensor, vertices, surface)
        flat = volumes(snapped, tets) < _SLIVER * volumes(vertices, tets)
        # A tetrahedron with all corners on one true face has no volume left: the face passes under it.
        drop = flat & np.isin(tets, surface).all(axis=1)
        if not flat.any():
            break
        _center(vertices, snapped, tets, np.setdiff1d(tets[flat & ~drop], surface))
        tets = tets[~drop]
    return Snapped(snapped, tets, faces, taxel)


def _on_faces(sensor: Sensor, vertices: np.ndarray, surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions with the ``surface`` vertices on their true faces, and each vertex's taxel (or -1)."""
    skin, places = sensor.skin, vertices.copy()
    taxel = np.full(len(vertices), -1)
    p = places[surface]
    for axis, half in ((0, skin.size_x / 2), (1, skin.size_y / 2)):
        near = (np.abs(np.abs(p[:, axis]) - half) < SNAP) & (p[:, 2] > -SNAP)
        p[near, axis] = np.sign(p[near, axis]) * half
    p[np.abs(p[:, 2] - skin.thickness) < SNAP, 2] = skin.thickness
    bump = np.zeros(len(p), dtype=bool)
    if skin.protrusion_radius:
        bump, nearest = _on_protrusions(sensor, p)
        taxel[surface] = np.where(bump, nearest, -1)
    p[(np.abs(p[:, 2]) < SNAP) & ~bump, 2] = 0.0
    places[surface] = p
    return places, taxel


def _on_protrusions(sensor: Sensor, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move those of points (n, 3) that belong to a protrusion; return which, and each point's nearest taxel."""
    shape, centers = Protrusion.of(sensor.skin), sensor.taxels.centers
    offset = p[:, None, :2] - centers[None]
    nearest = np.hypot(offset[..., 0], offset[..., 1]).argmin(axis=1)
    local = np.concatenate([offset[np.arange(len(p)), nearest], p[:, 2:]], axis=1)
    away = np.abs(shape.away(local))
    bump = (p[:, 2] < SNAP / 2) & (away < _SNAP_SPHERE * shape.radius)
    bump &= (p[:, 2] < -SNAP / 2) | (away < SNAP)
    rim = bump & (p[:, 2] > -SNAP / 2)
    # On the rim both the plane and the sphere hold, so such a vertex has one place along the circle.
    foot = local[rim, :2] * (shape.radius / np.linalg.norm(local[rim, :2], axis=1, keepdims=True))
    p[rim] = np.column_stack([centers[nearest[rim]] + foot, np.zeros(rim.sum())])
    on = bump & ~rim
    p[on] = np.column_stack([centers[nearest[on]], np.zeros(on.sum())]) + shape.project(local[on])
    return bump, nearest


def _center(vertices: np.ndarray, snapped: np.ndarray, tets: np.ndarray, inner: np.ndarray) -> None:
    """Move inner vertices, whose elements the snapped surface has flattened, to the mean of their neighbours."""
    for vertex in inner:
        around = np.setdiff1d(tets[(tets == vertex).any(axis=1)], [vertex])
        vertices[vertex] = snapped[around].mean(axis=0)
