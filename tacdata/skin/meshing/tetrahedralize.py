"""A closed surface to tetrahedra, by fTetWild (Hu et al. 2020)."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable

import numpy as np
import trimesh

from tacdata.sensor import Skin
from tacdata.skin.meshing.background import background
from tacdata.skin.meshing.settings import MeshSettings


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
    """
    import pytetwild

    points, cells, size = background(skin, settings, below)
    # fTetWild leaves a file of its own in the working folder.
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        vertices, tets = pytetwild.tetrahedralize(  # pyright: ignore[reportPrivateImportUsage]
            hull.vertices, hull.faces.astype(np.int32), edge_length_abs=settings.interior, epsilon=settings.envelope,
            num_threads=1, bg_vertices=points, bg_tets=cells, bg_values=size,
        )
    return np.asarray(vertices, dtype=float), np.asarray(tets, dtype=np.int32)
