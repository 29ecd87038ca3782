"""What every indenter in the room must satisfy; a new file is tested by lying there."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.indenters import Indenter, from_document
from tacdata.indenters.indenter import BASE, ROOM
from tacdata.warp_runtime import wp

NAMES = registry.names(ROOM, BASE)
Parameters = wp.types.vector(length=8, dtype=wp.float64)


@cache
def compiled(name):
    """One kernel a shape; every size runs through it."""
    distance = registry.load(ROOM, BASE, name, Indenter).example().distance_function()

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(p: wp.array(dtype=wp.vec3d), q: Parameters, d: wp.array(dtype=wp.float64)):
        i = wp.tid()
        d[i] = distance(p[i], q)

    return evaluate


def distance(indenter, points):
    points = np.ascontiguousarray(points.reshape(-1, 3))
    q = Parameters(*indenter.parameters, *[0.0] * (8 - len(indenter.parameters)))
    result = wp.zeros(len(points), dtype=wp.float64, device="cpu")
    positions = wp.array(points, dtype=wp.vec3d, device="cpu")
    wp.launch(compiled(indenter.shape), len(points), inputs=[positions, q, result], device="cpu")
    return result.numpy()


def gradient(indenter, points, step=1e-5):
    offsets = step * np.stack([np.eye(3), -np.eye(3)])
    d = distance(indenter, points[None, None] + offsets[:, :, None]).reshape(2, 3, len(points))
    return ((d[0] - d[1]) / (2 * step)).T


@pytest.fixture(params=NAMES)
def example(request):
    return registry.load(ROOM, BASE, request.param, Indenter).example()


def lower_points(indenter, height=2.0, count=61):
    """Points on the lower surface, below ``height``, shape (n, 3)."""
    samples = np.linspace(-1.0, 1.0, count) * indenter.extent
    x, y = np.meshgrid(samples, samples, indexing="ij")
    points = np.stack([x, y, indenter.profile(x, y)], axis=-1).reshape(-1, 3)
    return points[points[:, 2] < height]


def test_a_shape_ends_at_its_height(example):
    """One without goes on upward, so that a press of any depth has a meaning. Of a pair it is the lower solid's."""
    points = lower_points(example, height=1.0)
    lowest = points[points[:, 2] < points[:, 2].min() + 0.02] * [1.0, 1.0, 0.0]
    up = np.array([0.0, 0.0, 1.0])
    if np.isinf(example.height):
        assert (distance(example, lowest + 5.0 * up) < 0).all()
    else:
        below, above = (distance(example, lowest + (example.height + step) * up) for step in (-0.05, 0.05))
        assert ((below < 0) & (above > 0)).any()


def numbers(indenter):
    """Names of the parameters that are lengths, angles or factors."""
    return [f.name for f in dataclasses.fields(indenter) if isinstance(getattr(indenter, f.name), float)]


def scaled(indenter, factor):
    return dataclasses.replace(indenter, **{name: factor * getattr(indenter, name) for name in numbers(indenter)})


def slack(indenter):
    """How far slopes may be off [1]: an error of the distance over the length on which it varies."""
    return max(1e-6, 5 * indenter.exactness)


def test_the_room_is_not_empty():
    assert {"sphere", "flat_punch", "ring"} <= set(NAMES)


def test_at_most_eight_finite_parameters(example):
    assert 1 <= len(example.parameters) <= 8
    assert np.isfinite(example.parameters).all()


def test_one_distance_function_serves_every_size(example):
    assert scaled(example, 0.9).distance_function() is example.distance_function()


@pytest.mark.parametrize("factor", [1.0, 0.7, 1.15])
def test_distance_vanishes_on_the_profile_at_every_size(example, factor):
    indenter = scaled(example, factor)
    points = lower_points(indenter)
    assert len(points) > 500
    assert np.abs(distance(indenter, points)).max() < 1e-9


def test_negative_inside_positive_below(example):
    points = lower_points(example, height=1.0)
    inward = -gradient(example, points)
    assert (inward[:, 2] > -1e-9).all(), "the profile is the lower surface: its normal points down"
    assert (distance(example, points + 0.05 * inward) < -0.04).all()
    assert (distance(example, points - np.array([0.0, 0.0, 0.05])) > 0.0).all()


def test_exact_near_the_surface(example):
    rng = np.random.default_rng(1)
    base = lower_points(example)
    points = base[rng.integers(len(base), size=3000)] + rng.normal(0.0, 0.08, (3000, 3))
    d = distance(example, points)
    near = np.abs(d) < 0.15
    points, d = points[near], d[near]
    normal = gradient(example, points)
    assert near.sum() > 1000
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=slack(example))
    foot = points - d[:, None] * normal
    assert np.abs(distance(example, foot)).max() < max(1e-6, example.exactness)
    np.testing.assert_allclose(gradient(example, foot), normal, atol=2e-3 + slack(example))


def test_finite_and_growing_far_away(example):
    points = np.random.default_rng(2).uniform(-8.0, 8.0, (2000, 3))
    points[:6] = np.array([[0, 0, z] for z in (-3.0, 0.0, 0.5, 1.0, 1.5, 2.0)])
    d = distance(example, points)
    assert np.isfinite(d).all()
    assert distance(example, np.array([[0.0, 0.0, -5.0]]))[0] > 4.9
    neighbours = distance(example, points + np.array([1e-4, 1e-4, 0.0]))
    assert np.abs(neighbours - d).max() < 2e-4, "continuous with slope at most 1"


def test_lowest_point_is_the_origin_or_a_circle_around_it(example):
    at_origin = float(example.profile(np.zeros(1), np.zeros(1))[0])
    heights = lower_points(example, count=201)[:, 2]
    near = example.exactness if example.exactness > 1e-6 else 0.0
    assert heights.min() >= -near
    assert abs(at_origin) <= near or (np.isinf(at_origin) and heights.min() < 1e-3)


def test_nothing_beyond_the_extent(example):
    angle = np.linspace(0.0, 2 * np.pi, 60)
    r = 1.001 * example.extent
    assert np.isinf(example.profile(r * np.cos(angle), r * np.sin(angle))).all()


@pytest.mark.parametrize("height", [0.15, 6.0])
def test_surface_is_closed_and_lies_on_the_solid(example, height):
    mesh = example.surface(height)
    vertices = np.asarray(mesh.vertices)
    below = vertices[:, 2] < height - 1e-9
    assert mesh.is_watertight and mesh.volume > 0
    assert np.abs(distance(example, vertices[below])).max() < max(1e-6, example.exactness)
    assert (distance(example, vertices[~below]) < max(1e-6, example.exactness)).all()
    assert np.hypot(vertices[:, 0], vertices[:, 1]).max() <= example.extent + 1e-9
    assert vertices[:, 2].max() <= height + 1e-9 and abs(vertices[:, 2].min()) < 1e-9


def test_document_round_trip(example):
    assert from_document(example.document) == example
    assert example.document["shape"] == example.shape


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf"), "2", True, None])
def test_bad_parameters_are_refused(example, bad):
    assert numbers(example)
    for name in numbers(example):
        with pytest.raises(FormatError, match=name):
            dataclasses.replace(example, **{name: bad})


@pytest.mark.parametrize(
    ("shape", "change"),
    [
        ("flat_punch", {"edge_radius": 2.5}),
        ("cylinder", {"edge_radius": 1.6}),
        ("cylinder", {"length": 0.7}),
        ("cone", {"half_angle": 90.0}),
        ("cone", {"tip_radius": 3.0}),
        ("prism", {"angle": 180.0}),
        ("prism", {"edge_radius": 2.5}),
        ("ring", {"tube_radius": 2.5}),
        ("square_punch", {"edge_radius": 2.1}),
    ],
)
def test_contradicting_parameters_are_refused(shape, change):
    document = registry.load(ROOM, BASE, shape, Indenter).example().document
    with pytest.raises(FormatError, match="allowed"):
        from_document({**document, **change})


@pytest.mark.parametrize(
    ("shape", "change"),
    [
        ("flat_punch", {"edge_radius": 2.0}),
        ("cylinder", {"edge_radius": 1.5}),
        ("square_punch", {"edge_radius": 2.0}),
        ("cone", {"half_angle": 85.0}),
        ("prism", {"angle": 20.0}),
        ("ellipsoid", {"a": 2.0, "b": 2.0, "c": 2.0}),
        ("ellipsoid", {"a": 8.0, "b": 0.5, "c": 0.5}),
    ],
)
def test_limiting_sizes_are_exact_too(shape, change):
    indenter = from_document({**registry.load(ROOM, BASE, shape, Indenter).example().document, **change})
    points = lower_points(indenter)
    assert np.abs(distance(indenter, points)).max() < 1e-9
    outside = points - np.array([0.0, 0.0, 0.1])
    np.testing.assert_allclose(np.linalg.norm(gradient(indenter, outside), axis=1), 1.0, atol=1e-6)


def test_ellipsoid_with_equal_axes_is_the_sphere():
    ball = from_document({"shape": "sphere", "radius": 2.0})
    ellipsoid = from_document({"shape": "ellipsoid", "a": 2.0, "b": 2.0, "c": 2.0})
    points = np.random.default_rng(3).uniform(-4.0, 4.0, (500, 3)) + np.array([0.0, 0.0, 2.0])
    np.testing.assert_allclose(distance(ellipsoid, points), distance(ball, points), atol=1e-9)
