"""Between the states of a path: exact where the path is straight, bounded where it bends."""

from dataclasses import replace

import numpy as np
import pytest
from farm_examples import SENSOR, press_episode
from fast_model import path

from tacdata.label_farm.labels.make_label import make_label
from tacdata.label_farm.labels.margin import Margin
from tacdata.label_farm.labels.request import request
from tacdata.label_farm.presses.interpolate import Branch
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.labels import columns
from tacdata.transduction import Loads, Transducer

DEPTH = np.linspace(0.0, 1.5, 401)
CURVES = {
    "hertz": lambda d: d**1.5,
    "square": lambda d: d**2,
    "late contact": lambda d: max(0.0, d - 0.37),
    "stiffening": lambda d: np.expm1(2 * d) / 20,
    "early": lambda d: d**0.75,
    "S": lambda d: 1 / (1 + np.exp(-6 * (d - 0.75))) - 1 / (1 + np.exp(4.5)),
}


def label_of(tmp_path, answer, **changes):
    episode = press_episode(tmp_path, frames=400, **changes)
    wish = request(episode, SENSOR, "0" * 64, Ladder())
    return wish, make_label(wish, path(SENSOR, wish.job.depths, answer))


def test_a_path_linear_in_depth_is_exact_and_says_so(tmp_path):
    wish, label = label_of(tmp_path, lambda d: 0.8 * d, depth=1.5)
    bump = np.exp(-(SENSOR.map.x[:, None] ** 2 + SENSOR.map.y[None] ** 2) / 4.0)
    wanted = 0.8 * np.maximum(wish.tip[:, 2], 0)[:, None, None] * bump
    np.testing.assert_allclose(label.signed, wanted, atol=2e-7)
    assert label.error.max() < 1e-9


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("loading", [True, False])
def test_the_bound_holds_on_curved_paths_and_is_not_idle(name, loading):
    curve = CURVES[name]
    states = path(SENSOR, Ladder().depths(1.5), curve)
    branch = Branch.of(states, "force", loading)
    true = -np.array([curve(d) for d in DEPTH])
    error = np.abs(branch.at(DEPTH)[:, 2] - true)
    bound = branch.bound(DEPTH)[:, 2]
    assert error.max() > 1e-5, "the curve is no test"
    assert (error <= bound + 1e-12).all()
    assert error.max() <= bound.max() < 0.08 * np.abs(true).max()
    assert (branch.bound(branch.depth)[:, 2] < 1e-12).all(), "at a solved state nothing is interpolated"


def test_the_meshs_error_joins_what_is_lost_between_states(tmp_path):
    episode = press_episode(tmp_path, depth=1.5, frames=400)
    wish = request(episode, SENSOR, "0" * 64, Ladder())
    states = {share: path(SENSOR, wish.job.depths, lambda d: d**1.5, numerical=share) for share in (0.0, 0.02)}
    exact, meshed = (make_label(wish, solution) for solution in states.values())
    mesh = 0.02 * np.maximum(wish.tip[:, 2], 0) ** 1.5
    joined = np.sqrt(exact.error_map.astype(float) ** 2 + mesh[:, None, None] ** 2)
    np.testing.assert_allclose(meshed.error_map, joined, rtol=2e-3, atol=3e-4)
    rms = np.sqrt((meshed.error_map.astype(float) ** 2).mean(axis=(1, 2)))
    np.testing.assert_allclose(meshed.error, rms, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(meshed.force_error, np.hypot(exact.force_error, mesh), rtol=1e-2, atol=3e-4)
    assert exact.force_error.max() > 0.001 and meshed.force_error[200] == pytest.approx(mesh[200], rel=1e-2)
    np.testing.assert_allclose(meshed.taxel_area, meshed.taxel_closure)
    assert meshed.taxel_area.max() > 1


def test_without_contact_there_is_neither_a_map_nor_a_doubt(tmp_path):
    wish = request(press_episode(tmp_path, depth=-0.2), SENSOR, "0" * 64, Ladder())
    label = make_label(wish, None)
    assert not label.signed.any() and not label.error_map.any() and not label.taxel_area.any()


@pytest.mark.parametrize("name", sorted(set(CURVES) - {"late contact"}))
@pytest.mark.parametrize("loading", [True, False])
def test_a_state_left_out_is_missed_by_more_than_what_is_lost_between(name, loading):
    """At twice the spacing: four times for a smooth curve, hardly more where it is steepest, at first contact."""
    states = path(SENSOR, Ladder().depths(1.5), CURVES[name])
    branch = Branch.of(states, "surface", loading)
    lost = np.abs(branch.at(DEPTH) - Branch.of(path(SENSOR, DEPTH, CURVES[name]), "surface", True).values)
    bound = branch.left_out_beside(DEPTH)
    assert (lost.max(axis=1) <= bound + 1e-12).all()
    assert bound.max() < 0.08 * np.abs(branch.states).max(), "a bound that says nothing"


def test_a_state_on_a_straight_path_is_foretold_and_one_on_a_kink_is_not():
    depth = np.array([0.0, 0.2, 0.5, 1.0])
    straight = Branch(depth, np.stack([depth, -2 * depth], axis=1))
    assert straight.left_out().max() < 1e-15
    kinked = Branch(depth, np.maximum(depth - 0.2, 0.0)[:, None])
    assert kinked.left_out()[1, 0] > 0.05
    alone = Branch(np.array([0.0, 1.0]), np.array([[0.0], [0.7]]))
    assert alone.left_out().tolist() == [[0.7], [0.7]], "nothing foretells it"


def test_frames_that_do_not_touch_are_exactly_zero_and_others_are_not(tmp_path):
    episode = press_episode(tmp_path, depth=1.0, frames=300)
    wish = request(episode, SENSOR, "0" * 64, Ladder())
    states = path(SENSOR, wish.job.depths, lambda d: d**1.5, numerical=0.02)
    spread = {"uncertainty": 0.1 * states.surface, "force_uncertainty": 0.1 * np.abs(states.force)}
    label = make_label(wish, replace(states, **spread))
    apart = wish.tip[:, 2] <= 0
    assert 50 < apart.sum() < 250
    rest = SENSOR.transduction.offset[0]
    for name in columns.present(label):
        values = getattr(label, name)[apart]
        if name not in ("time_ns", "tip", "taxel_capacitance"):
            assert (values == (rest if name == "taxel_counts" else 0)).all(), name
            assert getattr(label, name)[~apart].any(), name
    assert len(np.unique(label.taxel_capacitance[apart])) == 1


def test_standard_deviations_follow_the_frames(tmp_path):
    episode = press_episode(tmp_path, depth=1.0, frames=200)
    wish = request(episode, SENSOR, "0" * 64, Ladder())
    states = path(SENSOR, wish.job.depths, lambda d: d)
    label = make_label(wish, replace(states, uncertainty=0.1 * states.surface))
    np.testing.assert_allclose(label.uncertainty, 0.1 * label.signed, rtol=6e-4, atol=1e-6)
    assert label.uncertainty.dtype == np.float16 and label.force_uncertainty is None
    margin = Margin.of(label)
    dented = label.signed > 0.1 * np.maximum(wish.tip[:, 2], 1e-9)[:, None, None]
    assert margin.uncertainty == pytest.approx(np.median(0.1 * label.signed[dented]), rel=1e-2)
    assert margin.between < 1e-9
    assert Margin.of(make_label(wish, states)).uncertainty is None


def test_tractions_follow_the_frames_where_the_path_knows_them(tmp_path):
    wish = request(press_episode(tmp_path, depth=1.0, frames=200), SENSOR, "0" * 64, Ladder())
    states = path(SENSOR, wish.job.depths, lambda d: d)
    label = make_label(wish, states)
    assert label.traction.shape == (200, 3, *SENSOR.map.shape) and label.traction.dtype == np.float16
    pressed = states.traction[states.depth.argmax(), 2] / states.depth.max()
    assert 0 < (pressed > 0).mean() < 0.2
    wanted = np.maximum(label.tip[:, 2], 0.0)[:, None, None] * pressed
    np.testing.assert_allclose(label.traction[:, 2], wanted, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(label.traction[:, 0], 0.1 * wanted, rtol=2e-3, atol=1e-6)
    assert label.taxel_pressure.shape == (200, 24, 10, 10) and label.taxel_pressure.dtype == np.float16
    borne = states.taxel_pressure[states.depth.argmax()] / states.depth.max()
    wanted = np.maximum(label.tip[:, 2], 0.0)[:, None, None, None] * borne
    np.testing.assert_allclose(label.taxel_pressure, wanted, rtol=2e-3, atol=1e-6)
    older = make_label(wish, replace(states, traction=None, taxel_pressure=None))
    assert older.traction is None and older.taxel_pressure is None


def test_a_label_says_what_the_taxels_would_read(tmp_path):
    wish = request(press_episode(tmp_path, depth=1.0, frames=200), SENSOR, "0" * 64, Ladder())
    states = path(SENSOR, wish.job.depths, lambda d: 0.05 * d**1.5)
    label = make_label(wish, states)
    loads = Loads(*(getattr(label, name).astype(float) for name in ("taxel_force", "taxel_closure", "taxel_area")))
    expected = Transducer.of(SENSOR).read(loads)
    np.testing.assert_allclose(label.taxel_counts, expected.counts, rtol=1e-6)
    np.testing.assert_allclose(label.taxel_capacitance, expected.capacitance, rtol=1e-6)
    assert np.ptp(label.taxel_counts) > 10
    assert label.provenance["parents"]["transduction"] == SENSOR.transduction.content_hash
    assert label.provenance["parameters"]["transduction"] == SENSOR.transduction.document
    silent = replace(wish, sensor=replace(SENSOR, transduction=None))
    label = make_label(silent, states)
    assert label.taxel_counts is None and "transduction" not in label.provenance["parents"]


def test_finer_steps_shrink_the_bound_at_second_order():
    largest = []
    for step in (0.2, 0.1, 0.05):
        states = path(SENSOR, Ladder(step, 1.0, step, step).depths(1.6), CURVES["square"])
        largest.append(Branch.of(states, "force", True).bound(np.linspace(0.4, 1.2, 999))[:, 2].max())
    assert largest[0] / largest[1] > 3.5 and largest[1] / largest[2] > 3.5


def test_loading_and_unloading_take_their_own_branch(tmp_path):
    episode = press_episode(tmp_path, depth=1.0, frames=400)
    wish = request(episode, SENSOR, "0" * 64, Ladder(unload_step=0.25))
    states = path(SENSOR, wish.job.depths, lambda d: d)
    peak = int(np.argmax(states.depth))
    factor = np.where(np.arange(len(states.depth)) <= peak, 1.0, 0.5)
    factor[peak] = 1.0
    states = replace(states, force=states.force * factor[:, None])
    label = make_label(wish, states)
    depth, seconds = wish.tip[:, 2], (wish.time_ns - wish.time_ns[0]) / 1e9
    down = (depth > 0.1) & (depth < 0.7) & (seconds < 1)
    up = (depth > 0.1) & (depth < 0.4) & (seconds > 2)
    np.testing.assert_allclose(label.force[down, 2], -depth[down], rtol=1e-5)
    np.testing.assert_allclose(label.force[up, 2], -0.5 * depth[up], rtol=1e-5)


def test_what_a_shared_path_leaves_out_is_in_the_error(tmp_path):
    _, exact = label_of(tmp_path, lambda d: d, number=0)
    _, deeper = label_of(tmp_path, lambda d: d, number=1, reached=1.004)
    episode = press_episode(tmp_path, 2, frames=400)
    aside = replace(episode, tip=episode.tip + np.array([0.015, 0.0, 0.0]))
    wish = request(aside, SENSOR, "0" * 64, Ladder())
    moved = make_label(wish, path(SENSOR, wish.job.depths, lambda d: d))
    bump = np.exp(-(SENSOR.map.x[:, None] ** 2 + SENSOR.map.y[None] ** 2) / 4.0)
    true = np.exp(-((SENSOR.map.x[:, None] - 0.015) ** 2 + SENSOR.map.y[None] ** 2) / 4.0)
    hold = 200
    assert exact.error[hold] < 1e-12
    assert deeper.error[hold] == pytest.approx(0.004 * np.sqrt((bump**2).mean()), rel=1e-3)
    assert moved.error[hold] == pytest.approx(np.sqrt(((true - bump) ** 2).mean()), rel=0.05)


@pytest.mark.parametrize("lag", [0.0, 0.01, 0.05])
def test_a_way_up_with_one_state_follows_the_way_down_and_owns_up_to_what_it_cannot_know(lag):
    """Friction's loop is a thin lens: what one state in its middle says of it leaves no frame outside the bound."""
    depths = Ladder().depths(1.2)
    peak = int(np.argmax(depths))
    assert len(depths) - peak == 3, "the deepest, one, and 0"
    states = path(SENSOR, depths, CURVES["hertz"])
    lens = lag * np.array(depths) * (1.2 - np.array(depths)) * (np.arange(len(depths)) > peak)
    branch = Branch.of(replace(states, force=states.force - lens[:, None] * np.array([0.0, 0.0, 1.0])), "force", False)
    true = -(DEPTH**1.5) - lag * DEPTH * (1.2 - DEPTH)
    inside = DEPTH <= 1.2
    error = np.abs(branch.at(DEPTH)[:, 2] - true)[inside]
    down = Branch.of(states, "force", True)
    assert (error <= branch.bound(DEPTH)[inside, 2] + 1e-12).all()
    assert error.max() <= np.abs(down.at(DEPTH)[inside, 2] + DEPTH[inside] ** 1.5).max() + 0.2 * lag * 0.36
    if lag:
        wider = branch.bound(DEPTH)[inside, 2] > down.bound(DEPTH)[inside, 2]
        assert wider.mean() > 0.9, "it is in doubt, and says so"
