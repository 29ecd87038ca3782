"""A law that loses stability under a press is named, not solved in silence."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import SolveError
from tacdata.indenters.sphere import Sphere
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.validity.stable_strain import StableStrain


def softening(share):
    """A slab of a Yeoh solid that softens."""
    sensor = slab_sensor(size=4.0, thickness=1.6, pixels=5)
    material = replace(sensor.material, law="yeoh", parameters={"c2_over_c1": share})
    return replace(sensor, material=material)


def test_strains_of_a_homogeneous_stretch_are_its_logarithms():
    mesh = box_mesh(slab_sensor(), 2, 2, 1)
    stretches = np.array([1.3, 0.9, 0.8])
    strains = StableStrain(mesh, slab_sensor().material).strains(mesh.nodes * (stretches - 1))
    expected = np.sort(np.log(stretches) - np.log(stretches).mean())
    np.testing.assert_allclose(strains, np.broadcast_to(expected, strains.shape), atol=1e-9)


def test_a_stable_law_has_no_remarks_and_a_softening_one_has():
    mesh = box_mesh(slab_sensor(), 2, 2, 1)
    assert StableStrain(mesh, slab_sensor().material).remarks == ()
    remarks = StableStrain(mesh, softening(-0.3).material).remarks
    assert len(remarks) == 3 and "uniaxial" in remarks[0]


def test_strain_beyond_the_stable_range_is_refused_with_its_place():
    sensor = softening(-0.3)
    mesh = box_mesh(sensor, 2, 2, 1)
    stable = StableStrain(mesh, sensor.material)
    stable.check(0.1, mesh.nodes * (np.array([1.1, 1.0, 1 / 1.1]) - 1))
    with pytest.raises(SolveError, match=r"yeoh is unstable in 96 of 96 points, worst at \[.*stretched by 0.50"):
        stable.check(0.5, mesh.nodes * (np.array([2.0, 1.0, 0.5]) - 1))


def test_a_press_within_the_stable_range_goes_through_with_a_remark_and_a_deeper_one_is_refused():
    sensor = softening(-0.3)
    model = SkinModel(sensor, ModelSettings(error_estimate=False), mesh=box_mesh(sensor, 4, 4, 2))
    assert "yeoh" in model.remarks[0]
    assert model.solve(PressRequest(Sphere(1.5), 0.0, 0.0, 0.0, (0.03,))).force[0, 2] > 0
    with pytest.raises(SolveError, match=r"unstable|no equilibrium"):
        model.solve(PressRequest(Sphere(1.5), 0.0, 0.0, 0.0, (0.03, 0.3, 0.6)))
