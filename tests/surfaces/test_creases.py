"""Sharp edges and corners of a surface."""

import numpy as np
import pytest
import trimesh

from tacdata.surfaces.creases import Creases


@pytest.fixture
def box():
    body = trimesh.creation.box(extents=[2, 2, 2]).subdivide()
    return Creases.of(np.asarray(body.vertices), np.asarray(body.faces))


def test_a_box_has_twelve_edges_and_eight_corners(box):
    assert len(box.ends) == 24, "each edge is divided once"
    assert np.linalg.norm(box.ends[:, 0] - box.ends[:, 1], axis=1).sum() == pytest.approx(24.0)
    assert sorted(map(tuple, np.abs(box.corners))) == [(1, 1, 1)] * 8


def test_points_go_to_the_edge_or_corner_within_reach(box):
    points = np.array([[0.99, 0.98, 0.3], [0.99, 1.01, -0.99], [0.9, 0.9, 0.2], [0.0, 0.0, 1.0]])
    moved, sharp = box.snapped(points, 0.03)
    assert moved == pytest.approx(np.array([[1, 1, 0.3], [1, 1, -1], [0.9, 0.9, 0.2], [0, 0, 1.0]]))
    assert list(sharp) == [True, True, False, False]


def test_a_ball_is_smooth():
    ball = trimesh.creation.icosphere(subdivisions=3)
    creases = Creases.of(np.asarray(ball.vertices), np.asarray(ball.faces))
    points = np.asarray(ball.vertices)[:5]
    moved, sharp = creases.snapped(points, 0.1)
    assert len(creases.ends) == 0 and not sharp.any() and np.array_equal(moved, points)
