"""Many presses at once: each as if it were alone, with its own material, thickness, shape and pose."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import SolveError
from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.ellipsoid import Ellipsoid
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import turned
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.batch import Batch
from tacdata.skin.solve.newton import Newton
from tacdata.skin.solve.settings import SolverSettings

SENSOR = slab_sensor(size=4.0, friction=0.2, pixels=9)
SETTINGS = ModelSettings(solver=SolverSettings(residual=1e-6), error_estimate=False)
"""Tight, so that what is compared is not the tolerance."""
PRESSES = [
    PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2, 0.4, 0.2)),
    PressRequest(Sphere(1.0), -0.5, 0.4, 0.0, (0.3,)),
    PressRequest(Sphere(2.0), 0.0, 0.6, 0.0, (0.1, 0.5, 0.0)),
    PressRequest(Cylinder(1.2, 2.0, 0.5), 0.1, 0.0, 20.0, (0.25,)),
]


@pytest.fixture(scope="module")
def model():
    """A slab of 4 x 4 x 2 mm; 845 nodes."""
    return SkinModel(SENSOR, SETTINGS, mesh=box_mesh(SENSOR, 6, 6, 2))


@pytest.fixture(scope="module")
def alone(model):
    return [model.solve(request) for request in PRESSES]


def solved(model, requests, capacity):
    """Solutions by number; every press is answered once."""
    found = list(model.solve_many(requests, capacity))
    assert sorted(number for number, _ in found) == list(range(len(requests)))
    return dict(found)


def walked(model, presses, request=PRESSES[0]):
    """States of presses that no `PressRequest` can express, in the presses' order; ``request`` says the shape."""
    batch = model.skin.batch([request], len(presses))
    states = {press.number: [] for press in presses}
    for number, _, state in batch.run(presses, model.skin.reader.states):
        states[number].append(state)
    return list(states.values())


def same(ours, theirs, tolerance=1e-5):
    assert np.abs(ours.force - theirs.force).max() < tolerance * np.abs(theirs.force).max()
    assert np.abs(ours.surface - theirs.surface).max() < tolerance * theirs.depth.max()
    assert ours.depth.tolist() == theirs.depth.tolist()
    assert ours.residual.max() <= SETTINGS.solver.residual


@pytest.mark.parametrize("capacity", [2, 3])
def test_presses_of_several_shapes_come_out_as_one_by_one(model, alone, capacity):
    """Spheres and a cylinder share a batch; with room for two, the cylinder follows in the column of a sphere."""
    together = solved(model, PRESSES, capacity)
    for number, single in enumerate(alone):
        same(together[number], single)


def test_states_come_in_the_order_of_the_path(model):
    depths = {number: [] for number in range(3)}
    for number, depth, state in model.states_many(PRESSES[:3], 3):
        assert state.displacement.shape == (len(model.mesh.nodes), 3)
        depths[number].append(depth)
    assert [tuple(d) for d in depths.values()] == [request.depths for request in PRESSES[:3]]
    assert model.last_run["ticks"] > 0 and model.last_run["cg"] > model.last_run["ticks"]


def test_what_has_changed_is_evaluated_once_an_iteration(model, monkeypatch):
    """Members that found a state and those that failed, together; those that go on are not evaluated again."""
    judge, again, step = Batch._judge, Newton.updated, Batch._step
    changed, sent, seen = [], [], set()
    monkeypatch.setattr(Newton, "updated", lambda *now: changed.append(now[-1].tolist()) or again(*now))

    def judged(own, now):
        changed.clear()
        verdicts = judge(own, now)
        # One attempt is made to fail, as no press of this slab does by itself.
        if "failed" not in seen and "found" in verdicts and "go on" in verdicts and verdicts.count("idle") == 0:
            verdicts[verdicts.index("go on")] = "failed"
        seen.update(verdicts)
        sent[:] = [column for column, verdict in enumerate(verdicts) if verdict in ("found", "failed")]
        return verdicts

    def stepped(own, now):
        assert changed == ([sent] if sent else [])
        step(own, now)

    monkeypatch.setattr(Batch, "_judge", judged)
    monkeypatch.setattr(Batch, "_step", stepped)
    presses = [PressRequest(Sphere(1.5), x, 0.1, 0.0, (0.2, 0.4)) for x in (-0.4, -0.1, 0.2, 0.5)]
    assert len(list(model.states_many(presses, 4))) == 8
    assert {"found", "failed", "go on"} <= seen


def test_a_batch_that_shrinks_keeps_everything_of_those_that_go_on(model):
    """Four spheres, of which two are done early: the others' states are what they are alone."""
    short = [PressRequest(Sphere(1.5), x, 0.1, 0.0, (0.1,)) for x in (-0.4, 0.5)]
    long = [PressRequest(Sphere(1.5), x, 0.1, 0.0, (0.2, 0.4, 0.2)) for x in (-0.1, 0.2)]
    together = solved(model, [short[0], long[0], short[1], long[1]], 4)
    for number, request in ((0, short[0]), (1, long[0]), (2, short[1]), (3, long[1])):
        same(together[number], model.solve(request))


def test_an_observer_is_told_every_equilibrium_from_the_touch_on(model):
    """With the history that it was found with; depths between those wanted are told, too."""
    told, numbers = [], []
    placed = [model.skin.placed(k, PressRequest(Sphere(1.5), 0.3 * k, 0.0, 0.0, (0.4,))) for k in range(2)]

    def note(presses, reached):
        numbers.append(presses)
        told.append(reached)

    batch = model.skin.batch(PRESSES[:1], 2)
    found = list(batch.run(placed, lambda new: [new.u[..., k] for k in range(len(new.column))], note))
    touch, *others = told
    assert numbers[0] == [0, 1] and {k for both in numbers for k in both} == {0, 1}
    assert all(len(both) == at.u.shape[2] for both, at in zip(numbers, told, strict=True))
    assert touch.u.shape[2] == 2 and not touch.u.any() and not touch.multipliers[0].any()
    assert sum(at.u.shape[2] for at in others) > len(found) == 2
    [first, *_, last] = others
    assert torch.isfinite(first.histories[0].gap).all() and last.multipliers[0].any() and last.histories[0].held.any()
    assert any(torch.equal(last.u[..., -1], u) for _, _, u in found)


def test_what_presses_share_does_not_change_while_they_are_solved(model):
    """Mesh, body, surfaces and tangent hold the same objects before and after."""
    newton = model.skin.newton(PRESSES[:1])
    shared = [model.skin.mesh, model.skin.body, newton.tangent, *newton.surfaces, newton]
    before = [dict(vars(one)) for one in shared]
    batch = Batch(newton, model.skin.conditions.pressed_by(PRESSES[0].indenter), len(model.mesh.nodes), 1, 0.0)
    [_] = batch.run([model.skin.placed(0, PRESSES[1])], model.skin.reader.states)
    for one, kept in zip(shared, before, strict=True):
        assert vars(one).keys() == kept.keys() and all(vars(one)[name] is kept[name] for name in kept)


def test_displacements_are_left_out_where_not_wanted(model):
    [(_, _, state)] = model.states_many(PRESSES[1:2], with_displacement=False)
    assert state.displacement.size == 0 and state.force[2] > 0


def test_no_presses_give_nothing(model):
    assert list(model.states_many([])) == [] and list(model.solve_many([])) == []


GOOD = [PressRequest(FlatPunch(1.0, 0.9), x, 0.1, 0.0, (0.15, 0.3)) for x in (-0.3, 0.2, 0.4)]
CRUSHING = PressRequest(FlatPunch(1.5, 0.9), 0.0, 0.0, 0.0, (0.02, 1.98))
"""To a hundredth of the thickness of a nearly incompressible slab whose bottom is held."""


@pytest.fixture(scope="module")
def coarse():
    """The same slab in few elements, soon given up: what fails costs many attempts."""
    solver = replace(SETTINGS.solver, patience=4, cg_limit=60, newton_limit=40)
    return SkinModel(SENSOR, replace(SETTINGS, solver=solver), mesh=box_mesh(SENSOR, 4, 4, 1))


@pytest.fixture(scope="module")
def crushed(coarse):
    """All answers to a press that diverges among three that do not, and what the walk yielded of it before."""
    found = []

    def walk(*arguments, **named):
        for state in SkinModel.states_many(coarse, *arguments, **named):
            found.append(state)
            yield state

    with pytest.MonkeyPatch.context() as patch:
        # Steps need not be halved to 0.01 mm to be given up.
        patch.setattr("tacdata.skin.solve.load_path._LEAST_STEP", 0.1)
        patch.setattr(coarse, "states_many", walk)
        together = solved(coarse, [GOOD[0], CRUSHING, *GOOD[1:]], 3)
    return together, [state for state in found if state[0] == 1]


@pytest.mark.long("tacdata/skin", reason="a press without an equilibrium is tried again and again")
def test_a_press_that_diverges_leaves_its_neighbours_alone(coarse, crushed):
    together = dict(crushed[0])
    failure = together.pop(1)
    assert isinstance(failure, SolveError)
    assert "flat_punch at (0, 0) mm: no equilibrium beyond depth" in str(failure)
    assert "reduce the depth" in str(failure)
    for number, request in zip((0, 2, 3), GOOD, strict=True):
        same(together[number], coarse.solve(request))


@pytest.mark.long("tacdata/skin", reason="a press without an equilibrium is tried again and again")
def test_a_press_that_goes_wrong_says_so_after_the_states_that_it_reached(crushed):
    (number, depth, state), (_, reached, failure) = crushed[1]
    assert (number, depth) == (1, 0.02) and state.force[2] > 0
    assert isinstance(failure, SolveError) and 0.02 <= reached < 1.98


def test_a_material_without_numbers_is_given_up_and_its_neighbour_is_not(model, alone):
    """Whatever makes a member's fields NaN, they stay in its own column."""
    press = model.skin.placed(0, PRESSES[0])
    broken = replace(press.conditions, law=torch.full_like(press.conditions.law, torch.nan))
    sick = replace(press, conditions=broken)
    [failed], healthy = walked(model, [sick, model.skin.placed(1, PRESSES[0])])
    assert isinstance(failed, SolveError) and "residual is nan" in str(failed)
    assert [state.force[2] for state in healthy] == pytest.approx(alone[0].force[:, 2], rel=1e-5)


def test_force_is_proportional_to_each_members_modulus(model):
    """Contact stiffness scales with it, so the displacements are the same."""
    base = model.skin.placed(0, PRESSES[0])
    presses = [
        replace(
            model.skin.placed(k, PRESSES[0]),
            conditions=conditions(
                replace(SENSOR.material, youngs_modulus=factor * SENSOR.material.youngs_modulus),
                SENSOR.contact.friction,
                PRESSES[0].indenter,
            ),
        )
        for k, factor in enumerate((1.0, 0.5, 3.0))
    ]
    assert base.conditions.modulus.item() == SENSOR.material.youngs_modulus
    plain, soft, stiff = walked(model, presses)
    for one, half, triple in zip(plain, soft, stiff, strict=True):
        assert 0.5 * one.force == pytest.approx(half.force, rel=1e-5, abs=1e-6)
        assert 3 * one.force == pytest.approx(triple.force, rel=1e-5, abs=1e-6)
        assert np.abs(one.displacement - triple.displacement).max() < 1e-5


def test_a_members_thickness_is_that_of_a_mesh_so_thick(model):
    """15 % thicker without another mesh, beside a member of the nominal thickness."""
    request, factor = PRESSES[0], 1.15
    thick = replace(SENSOR, skin=replace(SENSOR.skin, thickness=factor * SENSOR.skin.thickness))
    mesh = replace(model.mesh, nodes=model.mesh.nodes * [1.0, 1.0, factor])
    expected = [state for _, state in SkinModel(thick, SETTINGS, mesh=mesh).states(request)]
    press = model.skin.placed(0, request)
    own = conditions(SENSOR.material, SENSOR.contact.friction, request.indenter, thickness=factor)
    raised = replace(press, touch=press.touch * [1.0, 1.0, factor], conditions=own)
    found = walked(model, [raised, model.skin.placed(1, request)])
    for ours, nominal, theirs in zip(found[0], found[1], expected, strict=True):
        assert ours.force == pytest.approx(theirs.force, rel=1e-5, abs=1e-6)
        assert np.abs(ours.displacement - theirs.displacement).max() < 1e-5
        assert nominal.force[2] > 1.02 * ours.force[2]


def test_a_yawed_cylinder_presses_along_the_other_axis(model):
    """The mesh is the same with x and y exchanged: so are map and force of a cylinder yawed by 90 degrees."""
    shape = Cylinder(1.2, 2.0, 0.5)
    along, across = (
        model.solve(PressRequest(shape, x, y, yaw, (0.3,))) for x, y, yaw in ((0.4, 0.1, 0.0), (0.1, 0.4, 90.0))
    )
    assert across.force[0] == pytest.approx(along.force[0, [1, 0, 2]], rel=1e-5, abs=1e-5)
    assert np.abs(across.surface[0].T - along.surface[0]).max() < 1e-5
    assert np.abs(along.surface[0].T - along.surface[0]).max() > 0.01


def leaning(model, number, request, tilt_x, tilt_y):
    angles = (torch.tensor([angle], dtype=torch.float64) for angle in (0.0, tilt_x, tilt_y))
    return replace(model.skin.placed(number, request), turn=turned(*angles)[..., 0].numpy())


def test_tilts_about_x_and_y_are_mirror_images(model):
    """Exchanging x and y turns a tilt about x into the opposite one about y; a tilt drives force to its side."""
    request = PressRequest(FlatPunch(1.0, 0.5), 0.0, 0.0, 0.0, (0.2,))
    presses = [leaning(model, k, request, *tilt) for k, tilt in enumerate(((0.2, 0.0), (0.0, -0.2), (0.0, 0.0)))]
    [about_x], [about_y], [upright] = walked(model, presses, request)
    assert about_y.force == pytest.approx(about_x.force[[1, 0, 2]], rel=1e-5, abs=1e-5)
    assert np.abs(about_x.force - upright.force).max() > 0.02 * upright.force[2]


def test_a_sphere_tilted_about_its_centre_leaves_the_same_map(model):
    request = PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.3,))
    plain, tilted = model.skin.placed(0, request), leaning(model, 1, request, 0.3, -0.2)
    centre = plain.touch + np.array([0.0, 0.0, 1.5])
    tilted = replace(tilted, touch=centre - 1.5 * tilted.turn[:, 2])
    [one], [other] = walked(model, [plain, tilted])
    assert np.abs(tilted.touch - plain.touch).max() > 0.2
    assert other.force == pytest.approx(one.force, rel=1e-5, abs=1e-5)
    assert np.abs(other.displacement - one.displacement).max() < 1e-5


def test_an_impossible_press_is_named_and_takes_no_other_along(model):
    good = PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.2,))
    beside = PressRequest(Sphere(1.5), 99.0, 0.0, 0.0, (0.2,))
    answers = dict(model.solve_many([good, beside, good], 2))
    assert isinstance(answers[1], SolveError) and "99" in str(answers[1])
    assert answers[0].force[0, 2] == pytest.approx(answers[2].force[0, 2], rel=1e-6)
    assert answers[0].force[0, 2] > 0.01


def test_where_slips_flip_by_frictions_tangent_the_secant_takes_over(monkeypatch):
    """A leaning ellipsoid, 0.4 mm deep: by the whole tangent from a residual of 0.1 it goes up and down for ever.

    Even in small steps there is no way past; with the secant the depth is reached in one.
    """
    monkeypatch.setattr("tacdata.skin.solve.newton._NEAR", 0.1)
    monkeypatch.setattr("tacdata.skin.solve.newton._TANGENT", 1.0)
    sensor = slab_sensor(friction=0.2)
    slab = SkinModel(sensor, ModelSettings(error_estimate=False), mesh=box_mesh(sensor, 6, 6, 2))
    request = PressRequest(Ellipsoid(3.0, 1.8, 2.0), 0.5, 1.0, 40.0, (0.2, 0.4), 8.7, 1.0)
    judge, seen = Batch._judge, []

    def judged(own, now):
        verdicts = judge(own, now)
        attempt = own._presses[0].path.attempt
        seen.append((attempt, now.relative.item(), bool(own._at.friction_tangent.item()), verdicts[0]))
        return verdicts

    monkeypatch.setattr(Batch, "_judge", judged)
    _, (_, deep) = slab.states(request)
    assert deep.force[2] == pytest.approx(0.4214, abs=5e-4)
    assert not any(verdict == "failed" for *_, verdict in seen)
    # Near enough for the tangent, and yet by the secant.
    assert any(before[1] < 0.1 and not now[2] and now[0] == before[0] for before, now in pairwise(seen))
    seen.clear()
    monkeypatch.setattr("tacdata.skin.solve.batch._SLOW", math.inf)
    with pytest.raises(SolveError, match=r"no equilibrium beyond depth 0\.388 mm"):
        list(slab.states(request))
    flipping = seen[-8:]
    errors = np.array([error for _, error, _, _ in flipping])
    assert all(attempt == 0.4 and tangent for attempt, _, tangent, _ in flipping)
    assert errors.min() > 0.015 and errors.max() < 0.02
    assert np.all(np.diff(errors)[1:] * np.diff(errors)[:-1] < 0)


def test_a_start_never_decides_a_state(monkeypatch):
    """Unloading from the state before in place of the way down takes more steps to the same states."""
    sensor = slab_sensor(friction=0.2)
    slab = SkinModel(sensor, ModelSettings(error_estimate=False), mesh=box_mesh(sensor, 6, 6, 2))
    request = PressRequest(Sphere(1.5), 0.2, -0.1, 0.0, (0.2, 0.4, 0.2, 0.1))
    ours = [state for _, state in slab.states(request)]
    monkeypatch.setattr("tacdata.skin.solve.loading_states.LoadingStates.back", lambda own, now, *_, **__: now)
    theirs = [state for _, state in slab.states(request)]
    for one, other in zip(ours, theirs, strict=True):
        assert one.force == pytest.approx(other.force, abs=1e-3 * ours[1].force[2])
        assert np.abs(one.displacement - other.displacement).max() < 1e-3 * 0.4
    assert sum(one.newton for one in ours[2:]) < sum(other.newton for other in theirs[2:])


@pytest.mark.parametrize(
    "error", [torch.OutOfMemoryError("CUDA out of memory"), RuntimeError("Warp CUDA error 2: out of memory (in ...)")]
)
def test_more_presses_than_a_card_holds_are_refused_in_words(model, monkeypatch, error):
    def full(*_):
        raise error

    monkeypatch.setattr("tacdata.skin.solve.newton.Newton.step", full)
    with pytest.raises(SolveError, match="presses at a time on a mesh of") as refusal:
        list(model.states_many(PRESSES[:2], 2))
    assert "fewer at a time" in refusal.value.remedy
