"""From nodal tractions to the map: what is put on the face is on the map, wherever the face has moved."""

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.skin.surface.traction_map import TractionRaster

SENSOR = slab_sensor(size=6.0, pixels=13)
GRID = SENSOR.map


@pytest.fixture(scope="module", params=["structured", "unstructured"])
def mesh(request):
    if request.param == "structured":
        return box_mesh(SENSOR, 5, 4, 2)
    return request.getfixturevalue("slab").mesh


def contact_places(mesh):
    return mesh.nodes[np.unique(mesh.outer)][:, :2]


def test_a_constant_traction_is_found_at_every_inner_pixel(mesh):
    raster = TractionRaster(mesh, GRID)
    traction = np.tile([0.02, -0.01, 0.05], (raster.count, 1))
    found = raster.traction(np.zeros_like(mesh.nodes), traction)
    assert found.shape == (3, 13, 13)
    inner = found[:, 1:-1, 1:-1]
    # Quadrature points in place of an integral leave 1 % of grain.
    assert inner == pytest.approx(np.broadcast_to([[[0.02]], [[-0.01]], [[0.05]]], inner.shape), rel=0.02)


def test_a_linear_traction_is_found_where_it_is(mesh):
    places = contact_places(mesh)
    traction = np.stack([0 * places[:, 0], 0 * places[:, 0], 0.1 + 0.02 * places[:, 0] - 0.01 * places[:, 1]], axis=-1)
    found = TractionRaster(mesh, GRID).traction(np.zeros_like(mesh.nodes), traction)[2]
    x, y = np.meshgrid(GRID.x, GRID.y, indexing="ij")
    inner = (slice(1, -1), slice(1, -1))
    assert found[inner] == pytest.approx((0.1 + 0.02 * x - 0.01 * y)[inner], abs=0.002)


def test_the_force_stays_when_the_face_moves_and_stretches(mesh):
    """Half as wide, the face carries twice the force by area; what it carries in all is the same."""
    raster = TractionRaster(mesh, GRID)
    places = contact_places(mesh)
    traction = np.zeros((raster.count, 3))
    traction[np.hypot(*places.T) < 1.5, 2] = 0.04
    u = np.zeros_like(mesh.nodes)
    still = raster.traction(u, traction)[2]
    u[:, :2] = -0.5 * mesh.nodes[:, :2] + np.array([0.4, -0.3])
    moved = raster.traction(u, traction)[2]
    assert still.sum() * GRID.pixel_pitch**2 == pytest.approx(0.04 * np.pi * 1.5**2, rel=0.2)
    assert moved.sum() == pytest.approx(still.sum(), rel=1e-12)
    centre = np.array([(moved.sum(axis=1) * GRID.x).sum(), (moved.sum(axis=0) * GRID.y).sum()]) / moved.sum()
    assert centre == pytest.approx([0.4, -0.3], abs=0.1)
    assert moved.max() == pytest.approx(4 * 0.04, rel=0.05)


def test_what_lies_off_the_grid_is_not_counted(mesh):
    raster = TractionRaster(mesh, GRID)
    u = np.zeros_like(mesh.nodes)
    u[:, 0] = 50.0
    assert not raster.traction(u, np.ones((raster.count, 3))).any()
