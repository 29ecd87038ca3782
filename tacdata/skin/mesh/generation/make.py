"""A new mesh of a sensor's skin: the best of some, as the mesher gives another one at every run."""

from __future__ import annotations

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin.mesh.generation.own_surface import own_mesh
from tacdata.skin.mesh.generation.quadratic import quadratic
from tacdata.skin.mesh.generation.settings import MeshSettings
from tacdata.skin.mesh.generation.surface import surface
from tacdata.skin.mesh.generation.tetrahedralize import tetrahedralize
from tacdata.skin.mesh.skin_mesh import SkinMesh, quality

_REFUSALS = 3
"""How many meshes may fail to take the skin's true faces before the skin is refused [1]."""

_TRIES, _SLIVER, _FLAT = 6, 0.03, 1e-3
"""How often a slab is meshed in search of elements whose radius ratio is nowhere below this [1]."""


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
