"""A table of solved presses says about how far it is off between its nodes."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates

from tacdata.chain.table_response import TableResponse
from tacdata.errors import FormatError


def truth(pose):
    x, y, depth = pose.T
    spread = 1.0 + 0.3 * depth
    return np.maximum(depth, 0.0) ** 1.5 * np.exp(-((x - 0.4) ** 2 + y**2) / (2 * spread**2))


def at_depth(table, place):
    """Return a table's value at node coordinates."""
    ends = (1, np.zeros(table.shape[:2])), "not-a-knot"
    level = CubicSpline(np.arange(9), table, 2, ends)(place[2])
    return map_coordinates(level, place[:2, None], order=3, mode="mirror")[0]


def table(nodes):
    x, y, root = np.linspace(-3, 3, nodes), np.linspace(-2, 2, nodes), np.linspace(0, 1, nodes)
    grid = np.stack(np.meshgrid(x, y, root**2, indexing="ij"), axis=-1)
    load = truth(grid.reshape(-1, 3)).reshape(1, nodes, nodes, nodes, 1)
    curve = np.array([0.0, 2.0])
    return TableResponse(x, y, root**2, load, load[..., 0], curve, curve, np.ones(1), np.zeros(1), ("ball",))


@pytest.mark.parametrize("nodes", [9, 14, 25])
def test_polynomials_and_splines_differ_by_about_the_splines_error(nodes):
    made, rng = table(nodes), np.random.default_rng(1)
    pose = rng.uniform([-2.4, -1.5, 0.05], [2.4, 1.5, 0.9], (2000, 3))
    tool = np.zeros(len(pose), dtype=int)
    error = np.sqrt(np.mean((made.load(pose, tool)[:, 0] - truth(pose)) ** 2))
    said = np.sqrt(np.mean((made.load(pose, tool) - made.rougher().load(pose, tool)) ** 2))
    assert error / 3 < said < 12 * error


def test_rougher_says_the_same_at_nodes():
    made = table(9)
    pose = np.array([[made.x[3], made.y[5], made.depth[4]], [made.x[6], made.y[2], made.depth[7]]])
    tool = np.zeros(2, dtype=int)
    assert made.rougher().load(pose, tool) == pytest.approx(truth(pose)[:, None], rel=1e-9)
    assert made.load(pose, tool) == pytest.approx(truth(pose)[:, None], rel=1e-6)


def test_places_are_read_by_the_cubic_splines_through_the_nodes():
    """Against scipy's: places mirrored at their ends; the root of depth even at contact, not-a-knot at the deep end."""
    rng, shape = np.random.default_rng(2), (7, 6, 9)
    x, y, depth = np.linspace(-3, 3, 7), np.linspace(-2, 2, 6), np.linspace(0, 1, 9) ** 2
    load, force = rng.normal(size=(2, *shape, 5)), rng.normal(size=(2, *shape))
    curve = np.array([-9.0, 9.0])
    made = TableResponse(x, y, depth, load, force, curve, curve, np.ones(5), np.zeros(5), ("a", "b"))
    pose, tool = rng.uniform([-3, -2, -0.1], [3, 2, 1], (400, 3)), rng.integers(0, 2, 400)
    root = np.sqrt(np.maximum(pose[:, 2], 0.0))
    there = np.stack([(pose[:, 0] + 3), (pose[:, 1] + 2) / 0.8, root * 8])
    read = made.load(pose, tool)
    for c, found in ((0, read[:, 0]), (4, read[:, 4]), (None, made.force(pose, tool))):
        tables = force if c is None else load[..., c]
        both = [np.array([at_depth(table, place) for place in there.T]) for table in tables]
        expected = np.where(pose[:, 2] > 0, np.choose(tool, both), 0.0)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    fresh = made.with_tools([0, 1])
    np.testing.assert_array_equal(fresh.force(pose, tool), made.force(pose, tool), "alone, as beside the loads")


def test_the_deepest_presses_of_a_table_are_as_right_as_the_others():
    """Loads still grow at the deepest solved press; what lies just above it must not be bent flat."""
    made = table(9)
    depth = np.linspace(0.8, 1.0, 50)
    pose = np.column_stack([0 * depth, 0 * depth, depth])
    wrong = made.load(pose, np.zeros(50, dtype=int))[:, 0] / truth(pose) - 1
    assert np.abs(wrong).max() < 1e-4, "mirrored there, they are off by 7.6 %"


def test_the_curve_goes_on_straight_beyond_its_ends():
    x = np.linspace(-3, 3, 5)
    load, at = np.zeros((1, 5, 5, 5, 2)), np.array([0.0, 1.0, 2.0])
    made = TableResponse(
        x,
        x,
        np.linspace(0, 1, 5) ** 2,
        load,
        load[..., 0],
        at,
        np.array([0.0, 3.0, 4.0]),
        np.array([1.0, 10.0]),
        np.array([5.0, 0.0]),
        ("ball",),
    )
    read = made.signal(np.array([[-0.5, 0.5], [3.0, 2.0], [200.0, -100.0]]))
    assert read == pytest.approx(np.array([[3.5, 15.0], [10.0, 40.0], [207.0, -3000.0]]), rel=1e-12)


@pytest.mark.parametrize("rougher", [False, True])
def test_a_press_at_one_place_is_read_as_its_rows_would_be_by_themselves(rougher):
    """Along a press only depth changes, and a table of the place alone is read."""
    made = table(9).rougher() if rougher else table(9)
    depth = np.concatenate([np.linspace(-0.1, 1.0, 60), np.linspace(1.0, 0.0, 40)])
    places = np.array([[0.1, 0.3], [-3.0, 1.9], [0.1, 0.3], [2.99, -2.0]])
    pose = np.column_stack([np.repeat(places, len(depth), axis=0), np.tile(depth, len(places))])
    order = np.random.default_rng(3).permutation(len(pose))
    tool = np.zeros(len(pose), dtype=int)
    scattered = np.empty((len(pose), 1))
    scattered[order] = made.load(pose[order], tool)
    np.testing.assert_allclose(made.load(pose, tool), scattered, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(made.force(pose, tool), made.load(pose, tool)[:, 0])


def written(path, **changes):
    made, curve = table(3), np.array([0.0, 2.0])
    values = {
        "x": made.x,
        "y": made.y,
        "depth": made.depth,
        "load": np.zeros((1, 3, 3, 3, 1)),
        "force": np.zeros((1, 3, 3, 3)),
        "curve_load": curve,
        "curve_signal": curve,
        "gain": np.ones(1),
        "offset": np.zeros(1),
        "tools": np.array(["ball"]),
    }
    np.savez(path, **{**values, **changes})
    return path


def test_a_tables_stated_error_is_read_and_kept(tmp_path):
    assert TableResponse.read(written(tmp_path / "t.npz")).error == 0.0
    made = TableResponse.read(written(tmp_path / "t.npz", error=0.007))
    assert made.error == made.idling_at(np.ones(1)).error == 0.007


@pytest.mark.parametrize("error", [-0.1, np.nan, 7.0, [0.1, 0.2], "much"])
def test_an_error_that_is_no_share_is_refused(tmp_path, error):
    with pytest.raises(FormatError, match=r"t\.npz"):
        TableResponse.read(written(tmp_path / "t.npz", error=error))
