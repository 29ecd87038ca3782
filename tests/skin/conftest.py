"""One small model of each kind for the whole room; their meshes lie in `mesh/meshes/` (`running.user_cache`).

When `tacdata.skin.mesh.build.RECIPE` changes they are no longer found: replace them then.
"""

import pytest
import torch
from skin_examples import bumps_sensor, slab_sensor

from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.warp_runtime import wp


def _settings(**mesh):
    """Settings without the estimate of the mesh's error, which doubles the work and changes no other figure."""
    return ModelSettings(mesh=MeshSettings(**mesh), error_estimate=False)


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Start Warp; one thread, as in a worker of the farm."""
    wp.init()
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def slab():
    """A slab of 6 x 6 x 2 mm, bottom bonded, without friction, about 900 elements."""
    return SkinModel(slab_sensor(), _settings(outer=0.8, interior=1.2))


@pytest.fixture(scope="session")
def rough_slab(slab):
    """The same slab on the same mesh, with friction 0.2."""
    return SkinModel(slab_sensor(friction=0.2), slab.settings, mesh=slab.mesh)


@pytest.fixture(scope="session")
def fine_slab():
    """A wide slab, refined under its centre."""
    return SkinModel(slab_sensor(size=10.0), _settings(outer=1.2, interior=1.5, focus=(0.0, 0.0, 0.7, 0.16)))


@pytest.fixture(scope="session")
def bumps():
    """Four protrusions on a board."""
    return SkinModel(bumps_sensor(), _settings(outer=0.9, interior=1.5, protrusion=1.0, tip=None))
