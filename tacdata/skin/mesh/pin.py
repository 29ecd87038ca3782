"""Regenerate the shipped meshes of the default sensor: ``python -m tacdata.skin.mesh.pin``.

Needed when `tacdata.skin.mesh.build.RECIPE`, the default sensor's geometry or the default mesh settings change. It
makes a new version of the model. Of several attempts the mesh with the best worst element is kept. The coarser meshes
that the error estimate asks for (`tacdata.skin.mesh.coarser`) are pinned as well.
"""

from __future__ import annotations

from pathlib import Path

from tacdata.sensor import default_sensor
from tacdata.skin.mesh.build import PINNED, MeshSettings, mesh_key
from tacdata.skin.mesh.coarser import LEAST_RATIO, RATIOS, coarser, edge_ratio
from tacdata.skin.mesh.generation.make import make_mesh
from tacdata.skin.mesh.skin_mesh import SkinMesh, quality

ATTEMPTS = 5


def pin() -> list[Path]:
    """Replace the pinned meshes; return their paths, the model's own first."""
    fine = _best(MeshSettings())
    for old in PINNED.glob("*.npz"):
        old.unlink()
    return [_save(fine, MeshSettings()), *pin_companions(fine)]


def pin_companions(fine: SkinMesh) -> list[Path]:
    """Pin the coarser companion meshes of ``fine`` for the default sensor; return their paths."""
    paths = []
    for ratio in RATIOS:
        settings = coarser(MeshSettings(), ratio)
        mesh = _best(settings)
        paths.append(_save(mesh, settings))
        print(f"edges {edge_ratio(fine, mesh):.2f} times as long")
        if edge_ratio(fine, mesh) >= LEAST_RATIO:
            break
    return paths


def _best(settings: MeshSettings) -> SkinMesh:
    meshes = (make_mesh(default_sensor(), settings) for _ in range(ATTEMPTS))
    return max(meshes, key=lambda mesh: quality(mesh).worst_ratio)


def _save(mesh: SkinMesh, settings: MeshSettings) -> Path:
    path = PINNED / f"{mesh_key(default_sensor(), settings)}.npz"
    mesh.save(path)
    print(path.name, quality(mesh))
    return path


if __name__ == "__main__":
    pin()
