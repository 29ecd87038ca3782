"""Shape functions and quadrature of quadratic triangles and tetrahedra."""

from math import factorial

import numpy as np
import pytest
from skin_examples import tetrahedron_shapes

from tacdata.skin.mesh import elements

RANDOM = np.random.default_rng(1)
TRIANGLE_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
TET_CORNERS = np.concatenate([np.zeros((1, 3)), np.eye(3)])
TET_NODES = np.concatenate([TET_CORNERS, [(TET_CORNERS[a] + TET_CORNERS[b]) / 2 for a, b in elements.EDGES]])


def interior_points(dimension, count=20):
    return RANDOM.dirichlet(np.ones(dimension + 1), count)[:, 1:]


def test_triangle_shapes_are_one_at_their_node_and_sum_to_one():
    assert np.allclose(elements.triangle_shapes(TRIANGLE_NODES), np.eye(6), atol=1e-15)
    points = interior_points(2)
    assert np.allclose(elements.triangle_shapes(points).sum(axis=1), 1, atol=1e-14)
    assert np.allclose(elements.triangle_gradients(points).sum(axis=1), 0, atol=1e-14)


def test_triangle_gradients_are_those_of_the_shapes():
    points, h = interior_points(2), 1e-6
    for axis in range(2):
        step = h * np.eye(2)[axis]
        slope = (elements.triangle_shapes(points + step) - elements.triangle_shapes(points - step)) / (2 * h)
        assert np.allclose(elements.triangle_gradients(points)[:, :, axis], slope, atol=1e-9)


def test_tetrahedron_gradients_belong_to_the_stated_node_order():
    assert np.allclose(tetrahedron_shapes(TET_NODES), np.eye(10), atol=1e-15)
    points, h = interior_points(3), 1e-6
    assert np.allclose(elements.tetrahedron_gradients(points).sum(axis=1), 0, atol=1e-14)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        slope = (tetrahedron_shapes(points + step) - tetrahedron_shapes(points - step)) / (2 * h)
        assert np.allclose(elements.tetrahedron_gradients(points)[:, :, axis], slope, atol=1e-9)


def test_faces_look_outward():
    for a, b, c in elements.FACES:
        normal = np.cross(TET_CORNERS[b] - TET_CORNERS[a], TET_CORNERS[c] - TET_CORNERS[a])
        assert normal @ (TET_CORNERS[a] - TET_CORNERS.mean(axis=0)) > 0


def monomial_errors(points, weights, degree):
    """Largest error of the rule over the monomials of one degree on the unit simplex."""
    worst, dimension = 0.0, points.shape[1]
    for powers in np.ndindex(*[degree + 1] * dimension):
        if sum(powers) == degree:
            exact = np.prod([factorial(p) for p in powers]) / factorial(degree + dimension)
            worst = max(worst, abs(weights @ np.prod(points ** np.array(powers), axis=1) - exact))
    return worst


def test_the_tetrahedron_rule_is_exact_to_degree_two_and_no_further():
    points, weights = elements.tetrahedron_quadrature()
    assert max(monomial_errors(points, weights, d) for d in range(3)) < 1e-15
    assert monomial_errors(points, weights, 3) > 1e-4


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
def test_the_triangle_rule_is_exact_to_degree_four_and_no_further(subdivisions):
    points, weights = elements.triangle_quadrature(subdivisions)
    assert len(points) == 6 * subdivisions**2
    assert points.min() > 0 and points.sum(axis=1).max() < 1
    assert max(monomial_errors(points, weights, d) for d in range(5)) < 1e-14
    assert monomial_errors(points, weights, 5) > 1e-8
