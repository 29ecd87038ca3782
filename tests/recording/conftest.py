"""An emulated rig; and this folder on the path: tests of the sub-rooms import its examples by name."""

import pytest

from tacdata.virtual_rig.rig import VirtualRig


@pytest.fixture
def virtual(tmp_path, request, speed):
    """A rig that runs; its parameter says whether it has a camera."""
    rig = VirtualRig(tmp_path / "rig", speed, seed=5, camera=getattr(request, "param", False))
    rig.start()
    yield rig
    rig.stop()
