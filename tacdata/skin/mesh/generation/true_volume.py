"""The skin's volume by its geometry, to hold a mesh against."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor, Skin
from tacdata.skin.mesh.generation.bending import bend
from tacdata.skin.mesh.generation.protrusion import Protrusion
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.surfaces.closed import read_closed
from tacdata.surfaces.smooth import smooth
from tacdata.surfaces.store import find

_CHORD = 5e-4
"""Height of arcs over chords that may remain of the smooth surface of a file [mm]."""

_POINTS = 12
"""Gauss points along each axis of a bent slab."""


def true_volume(sensor: Sensor) -> float:
    """Return the volume of a skin by its geometry [mm^3].

    A protrusion of a bent pad is counted with the stretch at its middle.

    Raises:
        UsageError: If the skin's surface file is not on this machine.
    """
    skin = sensor.skin
    if skin.surface is not None:
        hull = read_closed(find(skin.surface.file, skin.surface.sha256, "skin"), skin.surface.scale, "skin")
        points, triangles, _ = smooth(np.asarray(hull.vertices, float), np.asarray(hull.faces)).divided(_CHORD)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        # Divergence theorem: signed tetrahedra from the origin to every triangle.
        return float(np.einsum("ij,ij->", np.cross(a, b), c) / 6)
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    half = np.array([skin.size_x, skin.size_y, skin.thickness]) / 2
    grid = np.stack(np.meshgrid(*[points] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * half + [0, 0, half[2]]
    share = np.einsum("i,j,k->ijk", *[weights] * 3).ravel() * np.prod(half)
    total = float(share @ _stretch(skin, grid))
    if skin.protrusion_radius:
        shape = Protrusion.of(skin)
        middle = np.full((sensor.taxels.count, 1), -0.4 * shape.height)
        total += shape.volume * float(_stretch(skin, np.hstack([sensor.taxels.centers, middle])).sum())
    return total


def volume_error(sensor: Sensor, mesh: SkinMesh) -> float:
    """Return the volume of a mesh over that of the skin, minus 1 [1]."""
    return float(mesh.shape_gradients()[1].sum()) / true_volume(sensor) - 1


def _stretch(skin: Skin, points: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Return the volume ratio of bending the flat pad [1], shape (n,), at points (n, 3) [mm]."""
    columns = [(bend(skin, points + step * e) - bend(skin, points - step * e)) / (2 * step) for e in np.eye(3)]
    return np.linalg.det(np.stack(columns, axis=-1))
