"""Skin above what presses it, found in the map of a solved press."""

from dataclasses import replace

import numpy as np
import pytest
from fast_model import path

from tacdata.indenters import from_document
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.simulated.swallowed_shape import swallowed_at
from tacdata.sensor import default_sensor
from tacdata.skin.contact.first_touch import rise, rotation
from tacdata.skin.press import PressRequest

SENSOR, DEPTHS = default_sensor(), (0.0, 0.2, 0.5, 0.9, 0.5, 0.0)
RING = {"shape": "ring", "ring_radius": 1.8, "tube_radius": 0.4}
PUNCH = {"shape": "flat_punch", "radius": 1.5, "edge_radius": 0.3}


def press(indenter, tilt=(0.0, 0.0)):
    return Job("s", "m", indenter, 0.7, -0.4, 20.0, DEPTHS, None, *tilt)


def solved(job, lift=0.0):
    """Maps of skin that lies on the shape from below, ``lift`` mm higher from 0.5 mm on; flat beside it."""
    shape, grid = from_document(job.indenter), SENSOR.map
    turn = rotation(PressRequest(shape, job.x, job.y, job.yaw, job.depths, tilt_x=job.tilt_x, tilt_y=job.tilt_y))
    fine = np.linspace(-shape.extent, shape.extent, 401)
    local = np.stack([*np.meshgrid(fine, fine, indexing="ij"), np.zeros((401, 401))]).reshape(3, -1)
    local[2] = shape.profile(local[0], local[1])
    place = turn @ local[:, np.isfinite(local[2])]
    bottom = np.full(grid.shape, np.inf)
    pixel = [
        np.abs(axis[:, None] - p[None]).argmin(axis=0)
        for axis, p in ((grid.x - job.x, place[0]), (grid.y - job.y, place[1]))
    ]
    np.minimum.at(bottom, tuple(pixel), place[2] + rise(shape, turn))
    found = path(SENSOR, job.depths, lambda d: d)
    raised = lift * (found.depth >= 0.5)
    return replace(found, surface=np.maximum(found.depth[:, None, None] - bottom, 0.0) - raised[:, None, None])


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4.0, -3.0), (-10.0, 8.0)])
@pytest.mark.parametrize("indenter", [RING, PUNCH])
def test_skin_on_the_underside_is_not_above_the_shape(indenter, tilt):
    job = press(indenter, tilt)
    assert swallowed_at(job, SENSOR, solved(job)) is None
    assert swallowed_at(job, SENSOR, solved(job, 0.1)) is None, "a coarse mesh reaches into a shape"


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4.0, -3.0)])
def test_a_ring_under_the_skin_is_found_at_the_first_depth(tilt):
    job = press(RING, tilt)
    assert swallowed_at(job, SENSOR, solved(job, 0.5)) == 0.5


def test_skins_whose_surface_is_a_file_are_not_judged(tmp_path):
    job, plane = press(RING), replace(SENSOR.skin, surface=object())
    assert swallowed_at(job, replace(SENSOR, skin=plane), solved(job, 0.5)) is None
