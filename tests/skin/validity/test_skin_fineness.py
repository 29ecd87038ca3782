"""Edges that slip between the points at which contact is seen are named."""

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.first_touch import reach
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.validity.fineness import edge_under, remark

SENSOR = slab_sensor()
MESH = box_mesh(SENSOR, 10, 10, 2)


def press(indenter, depths=(0.0, 0.1, 0.0)):
    return PressRequest(indenter, 0.2, 0.1, 0.0, depths)


def edge_of(request):
    return edge_under(MESH, request, reach(SENSOR, request))


def remark_on(request):
    return remark(MESH, SENSOR, request, reach(SENSOR, request))


def test_the_edge_is_that_of_the_triangles_under_the_press():
    assert edge_of(press(Sphere(2.0))) == pytest.approx(0.6)
    # Smaller than a triangle: the one that it lies in.
    assert edge_of(press(Sphere(0.05), (0.001,))) == pytest.approx(0.6)


def test_a_sharp_edge_is_named_with_the_mesh_that_would_see_it():
    words = remark_on(press(FlatPunch(1.0, 0.1)))
    assert "0.1 mm" in words and "0.3 mm apart" in words and "triangles of 0.2 mm would see it" in words


def test_blunt_shapes_and_fly_overs_pass_in_silence():
    assert remark_on(press(FlatPunch(1.0, 0.35))) == ""
    assert remark_on(press(FlatPunch(1.0, 0.01), (0.0,))) == ""


def test_a_solved_path_carries_the_remark():
    model = SkinModel(SENSOR, ModelSettings(error_estimate=False), mesh=box_mesh(SENSOR, 6, 6, 2))
    sharp, blunt = (model.solve(press(FlatPunch(1.0, e), (0.05,))).provenance["parameters"] for e in (0.15, 0.6))
    assert "sharpest radius" in sharp["remarks"][0]
    assert "remarks" not in blunt
    assert np.isfinite(sharp["seconds"])
