"""What the default solver settings leave of the exact solution on one mesh, on either device."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import DEVICES, EXACT, PLAIN, box_mesh, slab_sensor

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest

REQUESTS = [
    PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4, 0.2, 0.0)),
    PressRequest(Cylinder(1.2, 2.0, 0.5), 0.1, 0.0, 30.0, (0.3,)),
    PressRequest(FlatPunch(1.0, 0.9), -0.1, 0.2, 0.0, (0.3,)),
    PressRequest(Sphere(1.0), -0.4, 0.4, 0.0, (0.3,)),
]


@pytest.fixture(scope="module")
def sensor():
    return slab_sensor(size=4.0, friction=0.2, pixels=9)


@pytest.fixture(scope="module")
def exact(sensor):
    model = SkinModel(sensor, EXACT, mesh=box_mesh(sensor, 6, 6, 2))
    return [model.solve(request) for request in REQUESTS]


@pytest.mark.parametrize("device", DEVICES)
def test_forces_within_three_thousandths_and_maps_within_a_hundredth_of_the_depth(sensor, exact, device):
    """As far as two codes agree on one mesh. This one is coarse: a few faces carry each press."""
    model = SkinModel(sensor, PLAIN, device, box_mesh(sensor, 6, 6, 2))
    found = dict(model.solve_many(REQUESTS, len(REQUESTS)))
    for number, reference in enumerate(exact):
        press = found[number]
        assert np.abs(press.force - reference.force).max() < 3e-3 * np.abs(reference.force).max()
        off = press.surface - reference.surface
        assert np.abs(off).max() < 1e-2 * reference.depth.max()
        assert np.sqrt(np.mean(np.square(off))) < 2e-3 * reference.depth.max()


@pytest.mark.parametrize("device", DEVICES)
def test_tighter_settings_come_closer(sensor, exact, device):
    solver = replace(PLAIN.solver, residual=1e-4, penetration=3e-4, mean_penetration=3e-5)
    model = SkinModel(sensor, replace(PLAIN, solver=solver), device, box_mesh(sensor, 6, 6, 2))
    found = dict(model.solve_many(REQUESTS, len(REQUESTS)))
    for number, reference in enumerate(exact):
        off = found[number].surface - reference.surface
        assert np.sqrt(np.mean(np.square(off))) < 2e-4 * reference.depth.max()
