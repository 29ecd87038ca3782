"""Depth maps of many states: exact to bent triangles, the uppermost sheet, means over pixels, curved pads."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import UsageError
from tacdata.skin.mesh.generation.bending import bend
from tacdata.skin.surface.depth_map import DepthRaster
from tacdata.skin.surface.outer_face import OuterFace

SENSOR = slab_sensor(size=6.0, pixels=13)
X, Y = SENSOR.map.x, SENSOR.map.y
GRID = np.meshgrid(X, Y, indexing="ij")


@pytest.fixture(scope="module")
def mesh():
    return box_mesh(SENSOR, 5, 4, 2)


def state(mesh, ux, uy, uz):
    x, y = mesh.nodes[:, 0], mesh.nodes[:, 1]
    return torch.as_tensor(np.stack([ux(x, y), uy(x, y), uz(x, y)], axis=-1)[:, :, None])


def still(x, y):
    return np.zeros_like(x)


def bowl(x, y):
    return -0.3 + 0.05 * x + 0.03 * x * x - 0.01 * x * y + 0.02 * y * y


def test_triangles_that_bend_in_plan_are_followed_exactly(mesh):
    """x' = x + 0.06 x^2: quadratic, so nodes carry it exactly; its inverse is known."""
    u = state(mesh, lambda x, y: 0.06 * x * x, lambda x, y: 0.05 * x * y, bowl)
    found = DepthRaster(mesh, X, Y).depth(u)[0].numpy()
    x = (np.sqrt(1 + 4 * 0.06 * GRID[0]) - 1) / (2 * 0.06)
    y = GRID[1] / (1 + 0.05 * x)
    within = (np.abs(x) < 3) & (np.abs(y) < 3)
    assert within.sum() > 140
    assert found[within] == pytest.approx(-bowl(x, y)[within], abs=1e-10)


def test_under_a_fold_the_uppermost_sheet_counts(mesh):
    """x' = x - 1.5 sin 1.5 x lays three sheets over each other; the one with the largest x is the highest."""
    u = state(mesh, lambda x, y: -1.5 * np.sin(1.5 * x), still, lambda x, y: 0.1 * x)
    many = np.linspace(-2.4, 2.4, 49)
    found, covered = (t[0].numpy() for t in DepthRaster(mesh, many, Y).measure(u))
    face, y = OuterFace(mesh), Y[6]
    line = np.stack([np.linspace(-3, 3, 30001), np.full(30001, y)], axis=-1)
    moved = face.displacement(line, u[:, :, 0].numpy())
    folded = 0
    for i, x in enumerate(many):
        sheets = np.flatnonzero(np.diff(np.sign(line[:, 0] + moved[:, 0] - x)))
        folded += len(sheets) >= 3
        if len(sheets):
            assert covered[i, 6] == 1
            assert found[i, 6] == pytest.approx(-moved[sheets, 2].max(), abs=2e-4)
    assert folded >= 5


def test_a_sheet_that_looks_down_hides_nothing_above_it(mesh):
    """A face turned upside down as a whole is still skin."""
    u = state(mesh, lambda x, y: -2 * x, still, lambda x, y: still(x, y) - 0.5)
    assert DepthRaster(mesh, X, Y).depth(u)[0].numpy() == pytest.approx(np.full((13, 13), 0.5), abs=1e-12)


def test_means_over_pixels_are_exact_on_a_paraboloid(mesh):
    """The mean of x^2 over a pixel of side p is x^2 + p^2 / 12."""
    found = DepthRaster(mesh, X, Y, "area").depth(state(mesh, still, still, bowl))[0].numpy()
    assert found == pytest.approx(-bowl(*GRID) - (0.03 + 0.02) * 0.4**2 / 12, abs=1e-12)


def test_point_and_mean_differ_by_the_curvature_alone(mesh):
    linear = state(mesh, still, still, lambda x, y: 0.1 * x - 0.2 * y)
    point, area = (DepthRaster(mesh, X, Y, kind).depth(linear)[0].numpy() for kind in ("point", "area"))
    assert area == pytest.approx(point, abs=1e-12)


def test_beside_the_skin_the_depth_is_zero_and_said_to_be_uncovered(mesh):
    x = np.array([-3.4, -3.0, 0.0, 3.0, 3.4])
    depth, covered = DepthRaster(mesh, x, Y).measure(state(mesh, still, still, lambda x, y: still(x, y) - 0.2))
    assert covered[0, :, 6].tolist() == [0, 1, 1, 1, 0]
    assert depth[0, :, 6].tolist() == pytest.approx([0, 0.2, 0.2, 0.2, 0], abs=1e-12)


def test_a_rim_that_was_drawn_in_leaves_zero(mesh):
    u = state(mesh, lambda x, y: -0.2 * x, still, lambda x, y: still(x, y) - 0.2)
    depth, covered = DepthRaster(mesh, np.array([-2.9, 0.0]), Y).measure(u)
    assert covered[0, :, 6].tolist() == [0, 1]
    assert depth[0, :, 6].tolist() == pytest.approx([0, 0.2], abs=1e-12)


def test_a_mean_counts_the_covered_part_of_a_pixel(mesh):
    x = np.array([2.6, 3.0, 3.4])
    depth, share = DepthRaster(mesh, x, Y, "area").measure(state(mesh, still, still, lambda x, y: still(x, y) - 0.2))
    assert share[0, :, 6].tolist() == pytest.approx([1, 0.5, 0], abs=1e-12)
    assert depth[0, :, 6].tolist() == pytest.approx([0.2, 0.2, 0], abs=1e-12)


def test_every_state_of_a_batch_has_its_own_map_whatever_its_layout(mesh):
    states = [state(mesh, still, still, lambda x, y, k=k: bowl(x, y) * k) for k in (1, -2, 3)]
    together = torch.cat(states, dim=2)
    raster = DepthRaster(mesh, X, Y)
    maps = raster.depth(together)
    assert maps.shape == (3, 13, 13) and maps.dtype == torch.float64
    for k, single in enumerate(states):
        assert torch.equal(maps[k], raster.depth(single)[0])
    outside_first = together.permute(2, 0, 1).contiguous().permute(1, 2, 0)
    assert torch.equal(raster.depth(outside_first), maps)
    assert raster.depth(together.float()).numpy() == pytest.approx(maps.numpy(), abs=1e-6)


@pytest.mark.parametrize("radii", [(9.0, 0.0), (0.0, 7.0), (9.0, 9.0), (12.0, 8.0)])
@pytest.mark.parametrize("underside", ["bent", "flat"])
def test_depth_of_a_curved_pad_is_counted_from_its_own_height(mesh, radii, underside):
    """Everything sinks by 0.3 and moves by (0.2, 0): depth = h(x, y) - (h(x - 0.2, y) - 0.3)."""
    skin = replace(SENSOR.skin, curvature_radius_x=radii[0], curvature_radius_y=radii[1], underside=underside)
    curved = replace(mesh, nodes=bend(skin, mesh.nodes))
    u = state(curved, lambda x, y: still(x, y) + 0.2, still, lambda x, y: still(x, y) - 0.3)
    found, covered = (t[0].numpy() for t in DepthRaster(curved, X, Y).measure(u))
    expected = skin.outer_height(*GRID) - skin.outer_height(GRID[0] - 0.2, GRID[1]) + 0.3
    assert covered.min() == 1
    assert found == pytest.approx(expected, abs=4e-3), "quadratic triangles of 1.2 mm on a radius of 7 mm"
    rest = DepthRaster(curved, X, Y).depth(0 * u)[0].numpy()
    assert np.abs(rest).max() == 0


def test_the_height_of_a_curved_pad_is_that_of_its_formula(mesh):
    skin = replace(SENSOR.skin, curvature_radius_x=9.0, curvature_radius_y=9.0)
    curved = replace(mesh, nodes=bend(skin, mesh.nodes))
    corners = curved.nodes[np.unique(curved.outer)]
    assert corners[:, 2] == pytest.approx(skin.outer_height(*corners[:, :2].T), abs=1e-12)
    points = np.random.default_rng(3).uniform(-2.9, 2.9, (200, 2))
    assert OuterFace(curved).height(points) == pytest.approx(skin.outer_height(*points.T), abs=4e-3)


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_maps_on_cuda_are_those_of_the_cpu(mesh):
    factors = torch.linspace(-1, 1, 40, dtype=torch.float64)
    u = state(mesh, lambda x, y: -0.9 * np.sin(1.5 * x), lambda x, y: 0.05 * x * y, bowl) * factors
    for sampling in ("point", "area"):
        here, there = (DepthRaster(mesh, X, Y, sampling, device) for device in ("cpu", "cuda:0"))
        assert there.depth(u.cuda()).cpu().numpy() == pytest.approx(here.depth(u).numpy(), abs=1e-10)


def test_an_unknown_sampling_is_refused(mesh):
    with pytest.raises(UsageError, match="point, area"):
        DepthRaster(mesh, X, Y, "median")
    with pytest.raises(UsageError, match="not evenly spaced"):
        DepthRaster(mesh, np.array([0.0, 0.4, 1.0]), Y, "area")
