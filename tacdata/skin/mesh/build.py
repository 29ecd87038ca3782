"""From a sensor to its mesh: one that ships, one made before, or a new one (steps in `mesh.generation`)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.own_surface import own_mesh
from tacdata.skin.mesh.generation.quadratic import quadratic
from tacdata.skin.mesh.generation.settings import MeshSettings
from tacdata.skin.mesh.generation.surface import surface
from tacdata.skin.mesh.generation.tetrahedralize import tetrahedralize
from tacdata.skin.mesh.skin_mesh import SkinMesh, quality
from tacdata.surfaces.store import cache_folder

__all__ = ["PINNED", "RECIPE", "MeshSettings", "build_mesh", "make_mesh", "mesh_key", "quadratic", "surface"]

RECIPE = 2
"""Raised when `tacdata.skin.mesh.generation` would make another mesh from the same settings."""

PINNED = Path(__file__).parent / "shipped"
"""Meshes that ship with the model; made by `python -m tacdata.skin.mesh.pin`."""

_REFUSALS = 3
"""How many meshes may fail to take the skin's true faces before the skin is refused [1]."""

_TRIES, _SLIVER, _FLAT = 6, 0.03, 1e-3
"""How often a slab is meshed in search of elements whose radius ratio is nowhere below this [1]."""


def build_mesh(sensor: Sensor, settings: MeshSettings) -> SkinMesh:
    """Return the mesh of a sensor's skin: the one that ships with the model, one made before, or a new one.

    fTetWild does not give the same mesh twice. So the default sensor's mesh ships with the model, that labels are the
    same on every machine; any other is made once for each user and kept.

    Raises:
        SolveError: If the geometry cannot be meshed.
    """
    key = mesh_key(sensor, settings)
    for path in (PINNED / f"{key}.npz", cache_folder() / "meshes" / f"{key}.npz"):
        if path.exists():
            return SkinMesh.load(path)
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


def make_mesh(sensor: Sensor, settings: MeshSettings) -> SkinMesh:
    """Mesh a sensor's skin, without the cache.

    Raises:
        SolveError: If the geometry cannot be meshed.
        UsageError: If the skin's own surface file is not on this machine.
    """
    if sensor.skin.surface is not None:
        return own_mesh(sensor, sensor.skin.surface, settings)
    # fTetWild gives another mesh at every run, once in some dozens one with a sliver, or one that cannot be snapped.
    meshes, failed = [], []
    while len(meshes) < _TRIES and len(failed) < _REFUSALS and (not meshes or meshes[-1][0] < _SLIVER):
        try:
            mesh = quadratic(sensor, *tetrahedralize(surface(sensor, settings.tip), sensor.skin, settings))
            meshes.append((quality(mesh).worst_ratio, mesh))
        except SolveError as error:
            failed.append(error)
    if not meshes:
        raise failed[-1]
    ratio, mesh = max(meshes, key=lambda pair: pair[0])
    if ratio < _FLAT:
        raise SolveError(
            f"{_TRIES} meshes of the skin all have flat or inverted elements (best of their worst ratios: {ratio:.2g})",
            f"inscribed over circumscribed radius above {_FLAT:g} / 3",
            "choose a smaller element size, or check the skin's sizes against one another",
        )
    return mesh
