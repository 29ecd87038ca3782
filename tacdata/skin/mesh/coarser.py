"""A coarser mesh of the same skin, which the estimate of the mesh's error is made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh.build import MeshSettings, build_mesh
from tacdata.skin.mesh.skin_mesh import SkinMesh

RATIOS = (1.5, 2.0, 2.6)
"""Ratios of edge lengths that are tried, in this order, until the mesh is really coarser [1]."""

LEAST_RATIO = 1.3
"""Ratio of edge lengths, as counted, from which a mesh is coarser [1]; at 1.3 it costs half, at 1.5 a third."""


def coarser(settings: MeshSettings, ratio: float) -> MeshSettings:
    """Return settings whose edge lengths are ``ratio`` [1] times as long."""
    # Only the edge length of the focus scales; its place and radii describe the shape.
    focus = settings.focus and (*settings.focus[:3], ratio * settings.focus[3], *settings.focus[4:])
    return replace(
        settings,
        outer=ratio * settings.outer,
        interior=ratio * settings.interior,
        protrusion=ratio * settings.protrusion,
        tip=settings.tip and ratio * settings.tip,
        focus=focus,
    )


def edge_ratio(fine: SkinMesh, coarse: SkinMesh) -> float:
    """Return the edge length of a coarser mesh over that of a finer one [1], by the triangles of their outer faces."""
    # On one face the number of triangles goes with the inverse square of their edges.
    return float(np.sqrt(len(fine.outer) / len(coarse.outer)))


def blind_spot(fine: SkinMesh, coarse: SkinMesh) -> str:
    """Say where a coarser mesh is not coarser, so that the estimate misses the error made there; empty if nowhere."""
    if not len(fine.protrusions) or not len(coarse.protrusions):
        return ""
    ratio = np.sqrt(len(fine.protrusions) / len(coarse.protrusions))
    if ratio >= LEAST_RATIO:
        return ""
    return f"blind to the mesh of the protrusions, whose edges are only {ratio:.2f} times as long on the coarser mesh"


def companion_mesh(sensor: Sensor, settings: MeshSettings, fine: SkinMesh) -> SkinMesh | None:
    """Return a mesh of a sensor that is coarser than ``fine``, from `build_mesh`; None if there is none.

    The mesher keeps the geometry's own vertices and so need not follow the edge length asked for: the first of `RATIOS`
    is taken whose mesh is coarser by `LEAST_RATIO`, else the coarsest.
    """
    meshes: list[SkinMesh] = []
    for ratio in RATIOS:
        try:
            meshes.append(build_mesh(sensor, coarser(settings, ratio)))
        except SolveError:
            break
        if edge_ratio(fine, meshes[-1]) >= LEAST_RATIO:
            return meshes[-1]
    best = min(meshes, key=lambda mesh: len(mesh.outer), default=None)
    return best if best is not None and len(best.outer) < len(fine.outer) else None
