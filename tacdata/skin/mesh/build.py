"""From a sensor to its mesh: one that ships, one made before, or a new one (steps in `mesh.generation`)."""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from zipfile import BadZipFile, is_zipfile

from tacdata import provenance
from tacdata.paths import cache_folder
from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.settings import MeshSettings
from tacdata.skin.mesh.skin_mesh import SkinMesh

__all__ = ["PINNED", "RECIPE", "MeshSettings", "build_mesh", "mesh_key"]

RECIPE = 2
"""Raised when `tacdata.skin.mesh.generation` would make another mesh from the same settings."""

PINNED = Path(__file__).parent / "shipped"
"""Meshes that ship with the model; made by `python -m tacdata.skin.mesh.pin`."""


def build_mesh(sensor: Sensor, settings: MeshSettings) -> SkinMesh:
    """Return the mesh of a sensor's skin: the one that ships with the model, one made before, or a new one.

    fTetWild does not give the same mesh twice. So the default sensor's mesh ships with the model, that labels are the
    same on every machine; any other is made once for each user and kept.

    Raises:
        SolveError: If the geometry cannot be meshed.
    """
    key = mesh_key(sensor, settings)
    pinned, path = PINNED / f"{key}.npz", cache_folder() / "meshes" / f"{key}.npz"
    if pinned.exists():
        return SkinMesh.load(pinned)
    # A damaged file counts as none.
    if is_zipfile(path):
        with suppress(OSError, ValueError, KeyError, BadZipFile, zlib.error):
            return SkinMesh.load(path)
    # The packages that make one take longer to import than a mesh takes to read, and most presses only read one.
    from tacdata.skin.mesh.generation.make import make_mesh

    mesh = make_mesh(sensor, settings)
    mesh.save(path)
    # Where two processes made it at once, the last to write decides for both.
    return SkinMesh.load(path)


def mesh_key(sensor: Sensor, settings: MeshSettings) -> str:
    """Return the name under which a mesh is kept: a hash of its inputs (32 hex digits)."""
    centers = sensor.taxels.centers.tolist() if sensor.skin.protrusion_radius else []
    document = asdict(settings)
    # A tip size changes nothing without protrusions, so it must not make another key.
    if settings.tip is None or not sensor.skin.protrusion_radius:
        document.pop("tip")
    made_from = {"recipe": RECIPE, "skin": sensor.skin.identity, "protrusions": centers, "settings": document}
    return provenance.content_hash(made_from)[:32]
