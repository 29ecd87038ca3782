"""From a displacement field to the map: point sampling on the quadratic surface, against analytic fields."""

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.sensor import default_sensor
from tacdata.skin.surface.outer_face import OuterFace

SENSOR = slab_sensor(size=6.0, pixels=13)
X, Y = SENSOR.map.x, SENSOR.map.y


@pytest.fixture(scope="module", params=["structured", "unstructured"])
def mesh(request):
    if request.param == "structured":
        return box_mesh(SENSOR, 5, 4, 2)
    return request.getfixturevalue("slab").mesh


def field(mesh, ux, uy, uz):
    x, y = mesh.nodes[:, 0], mesh.nodes[:, 1]
    return np.stack([ux(x, y), uy(x, y), uz(x, y)], axis=-1)


def still(x, y):
    return np.zeros_like(x)


def quadratic(x, y):
    return -0.3 + 0.05 * x - 0.02 * y + 0.03 * x * x - 0.01 * x * y + 0.02 * y * y


def test_a_quadratic_field_is_reproduced_at_the_pixel_centres(mesh):
    found = OuterFace(mesh).depth_map(X, Y, field(mesh, still, still, quadratic))
    x, y = np.meshgrid(X, Y, indexing="ij")
    assert found.shape == (13, 13)
    assert found == pytest.approx(-quadratic(x, y), abs=1e-12)


def test_rows_run_along_x_and_columns_along_y(mesh):
    found = OuterFace(mesh).depth_map(X[:5], Y, field(mesh, still, still, lambda x, y: -x - 10 * y))
    assert found.shape == (5, 13)
    assert found[3, 7] == pytest.approx(X[3] + 10 * Y[7], abs=1e-12)


def test_pixel_centres_lie_half_a_pixel_inside_the_grid():
    """Even and odd counts: the grid is centred on the array, so an even one has no pixel at 0."""
    grid = default_sensor().map
    assert grid.x[[0, 17, 34]] == pytest.approx([-6.8, 0.0, 6.8])
    assert grid.y[[0, 12, 13, 25]] == pytest.approx([-5.0, -0.2, 0.2, 5.0])


def test_a_horizontal_shift_moves_the_map(mesh):
    """Everything moves by (0.3, -0.1): the height found above a pixel is that of the point which came from behind."""
    u = field(mesh, lambda x, y: still(x, y) + 0.3, lambda x, y: still(x, y) - 0.1, quadratic)
    found = OuterFace(mesh).depth_map(X, Y, u)
    x, y = np.meshgrid(X, Y, indexing="ij")
    assert found == pytest.approx(-quadratic(x - 0.3, y + 0.1), abs=1e-6)


def test_a_stretch_is_undone_exactly(mesh):
    """x' = 1.25 x, y' = 0.9 y + 0.1 x: the map is the field at the inverse image of the pixel."""
    u = field(mesh, lambda x, y: 0.25 * x, lambda x, y: 0.1 * x - 0.1 * y, quadratic)
    found = OuterFace(mesh).depth_map(X, Y, u)
    x, y = np.meshgrid(X, Y, indexing="ij")
    back = x / 1.25
    assert found == pytest.approx(-quadratic(back, (y - 0.1 * back) / 0.9), abs=1e-6)


def test_the_sign_is_kept(mesh):
    found = OuterFace(mesh).depth_map(X, Y, field(mesh, still, still, lambda x, y: 0.1 + 0 * x))
    assert found == pytest.approx(np.full((13, 13), -0.1))


def test_a_point_beside_the_face_gets_the_rim(mesh):
    found = OuterFace(mesh).displacement(np.array([[9.0, 0.5]]), field(mesh, still, still, quadratic))
    assert found[0, 2] == pytest.approx(quadratic(3.0, 0.5), abs=1e-9)


def test_every_point_is_found_in_a_triangle_that_holds_it(mesh):
    points = np.random.default_rng(2).uniform(-3, 3, (500, 2))
    triangle, local = OuterFace(mesh).locate(points)
    assert local.min() > -1e-9 and local.sum(axis=1).max() < 1 + 1e-9
    corners = mesh.nodes[mesh.outer[triangle, :3], :2]
    back = corners[:, 0] + np.einsum("ni,nij->nj", local, corners[:, 1:] - corners[:, :1])
    assert back == pytest.approx(points, abs=1e-9)


def folded(mesh, uz):
    return field(mesh, lambda x, y: -1.5 * np.sin(1.5 * x), still, uz)


def test_a_fold_at_one_height_shows_that_height(mesh):
    """Three sheets lie over each other near the middle; none may be missed, whatever the search does."""
    found = OuterFace(mesh).depth_map(X, Y, folded(mesh, lambda x, y: still(x, y) - 0.2))
    assert found == pytest.approx(np.full((13, 13), 0.2), abs=1e-9)


def test_under_a_fold_the_map_shows_one_of_the_sheets(mesh):
    face, u = OuterFace(mesh), folded(mesh, lambda x, y: 0.1 * x)
    line = np.stack([np.linspace(-3, 3, 6001), np.full(6001, Y[6])], axis=-1)
    moved = face.displacement(line, u)
    found = face.depth_map(X, Y[6:7], u)[:, 0]
    for x, depth in zip(X[3:10], found[3:10], strict=True):
        sheets = np.flatnonzero(np.diff(np.sign(line[:, 0] + moved[:, 0] - x)))
        assert np.abs(-moved[sheets, 2] - depth).min() < 0.01
