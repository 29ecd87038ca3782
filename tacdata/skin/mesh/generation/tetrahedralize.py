"""A closed surface to tetrahedra, by fTetWild (Hu et al. 2020)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from tacdata.sensor import Skin
from tacdata.skin.mesh.generation.background import background
from tacdata.skin.mesh.generation.ftetwild import ftetwild
from tacdata.skin.mesh.generation.settings import MeshSettings


def tetrahedralize(
    hull: trimesh.Trimesh, skin: Skin, settings: MeshSettings, below: Callable[[np.ndarray], np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [mm], shape (v, 3), and tetrahedra, shape (e, 4), int32.

    fTetWild keeps the surface only within an envelope, and gives another mesh at every run.

    Args:
        hull: The closed surface.
        skin: Sizes that the background mesh covers and is graded by.
        settings: Target edge lengths.
        below: Distance of points (n, 3) from the outer face [mm], shape (n,); None: from the plane z = thickness.

    Raises:
        SolveError: If it cannot be meshed.
    """
    points, cells, size = background(skin, settings, below)
    return ftetwild(hull.vertices, hull.faces, (points, cells, size), settings.interior, settings.envelope)
