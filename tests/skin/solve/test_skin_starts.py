"""Starts of load steps from a coarser mesh: what they read off it; they save steps and decide nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import DEVICES, EXACT, box_mesh, slab_sensor

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import default_sensor
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.coarse_path import CoarsePath, CoarseStart
from tacdata.skin.solve.configuration import Unknowns
from tacdata.skin.solve.mesh_transfer import MeshTransfer, nodal, tractions
from tacdata.skin.solve.starts import TOUCHING, Starts

REQUESTS = [
    PressRequest(Sphere(1.5), 0.2, -0.3, 0.0, (0.1, 0.25, 0.45, 0.2, 0.0)),
    PressRequest(Cylinder(1.2, 2.0, 0.5), 0.1, 0.0, 30.0, (0.2, 0.4)),
    PressRequest(FlatPunch(1.0, 0.9), -0.1, 0.2, 0.0, (0.15, 0.3)),
]


@pytest.fixture(scope="module")
def meshes():
    sensor = slab_sensor(size=4.0, friction=0.2, pixels=9)
    return sensor, box_mesh(sensor, 6, 6, 3), box_mesh(sensor, 4, 4, 2)


def test_a_quadratic_field_is_read_off_a_coarser_mesh_as_it_is(meshes):
    _, fine, coarse = meshes

    def field(nodes):
        x, y, z = nodes.T
        return np.stack([x * y, z**2 - x, 1 + y * z], axis=1)

    assert np.abs(nodal(coarse, fine) @ field(coarse.nodes) - field(fine.nodes)).max() < 1e-9


def test_a_linear_pressure_is_read_off_coarser_faces_as_it_is(meshes):
    _, fine, coarse = meshes
    there, here = (mesh.nodes[np.unique(mesh.outer)] for mesh in (coarse, fine))
    matrix = tractions(coarse.outer, coarse.nodes, fine.outer, fine.nodes)
    assert np.abs(matrix @ (1 + there[:, 0] - 2 * there[:, 1]) - (1 + here[:, 0] - 2 * here[:, 1])).max() < 1e-9


def test_nodes_outside_of_the_coarser_mesh_read_an_element_beside(meshes):
    sensor, fine, _ = meshes
    small = box_mesh(replace(sensor, skin=replace(sensor.skin, size_x=3.0, size_y=3.0)), 3, 3, 2)
    read = nodal(small, fine) @ small.nodes
    assert np.abs(read[:, :2]).max() < 1.5 + 1e-9, "places of the coarser mesh"
    outside = np.linalg.norm(fine.nodes - np.clip(fine.nodes, [-1.5, -1.5, 0.0], [1.5, 1.5, 2.0]), axis=1)
    assert (np.linalg.norm(read - fine.nodes, axis=1) < outside + 0.5).all(), "at most half an edge farther"


def unknowns(scale):
    u = scale * torch.arange(12, dtype=torch.float64).reshape(4, 3, 1)
    return Unknowns(u, (u[:2, 0], u[:3, 1]))


def test_changes_are_linear_between_states_and_unknown_beyond_the_last():
    path = CoarsePath.of([(0.0, unknowns(0)), (0.2, unknowns(1)), (0.4, unknowns(5))])
    assert path is not None and path.depth.tolist() == [0.0, 0.2, 0.4]
    for before, after, scale in ((0.0, 0.1, 0.5), (0.1, 0.3, 2.5), (0.2, 0.4, 4.0), (0.4, 0.2, -4.0)):
        change = path.change(before, after)
        assert change is not None and torch.allclose(change.u.double(), unknowns(scale).u)
        assert torch.allclose(change.multipliers[1].double(), unknowns(scale).multipliers[1])
    assert path.change(0.2, 0.41) is None
    assert CoarsePath.of([(0.0, unknowns(0))]) is None


@pytest.fixture
def flat(meshes):
    """Two members on the finer mesh at rest, and a path that knows of 0.2 mm."""
    _, fine, coarse = meshes
    sizes = [(len(mesh.nodes), len(np.unique(mesh.outer))) for mesh in (fine, coarse)]
    like = Unknowns(torch.zeros(sizes[0][0], 3, 2).double(), (torch.zeros(sizes[0][1], 2).double(),))
    there = Unknowns(torch.ones(sizes[1][0], 3, 1).double(), (torch.ones(sizes[1][1], 1).double(),))
    path = CoarsePath.of([(0.2, there)])
    assert path is not None
    return like, CoarseStart(path, MeshTransfer(coarse, fine, 1, "cpu"))


def guess(like, coarse, sticky=False, attempt=0.2):
    which, depth, starts = torch.tensor([True, True]), torch.zeros(2).double(), Starts(like, sticky)
    starts.forget(torch.arange(2))
    return starts.guess(which, depth, depth + attempt, coarse)


def test_a_member_with_a_coarser_path_takes_its_change_and_its_active_nodes(flat):
    like, start = flat
    found, near = guess(like, {1: start})
    assert torch.allclose(found.u[:, :, 1], torch.ones_like(found.u[:, :, 1])) and not found.u[:, :, 0].any()
    assert torch.allclose(found.multipliers[0][:, 1], torch.ones_like(found.multipliers[0][:, 1]))
    assert near.tolist() == [TOUCHING, 0.0]


def test_beyond_the_coarser_path_and_on_a_sticky_skin_the_step_before_goes_on(flat):
    like, start = flat
    for found, near in (guess(like, {1: start}, attempt=0.3), guess(like, {1: start}, sticky=True)):
        assert not found.u.any() and near.tolist() == [TOUCHING, TOUCHING]


def guesses(meshes, device):
    """Starts of three members: one goes down with a coarser path, one without, one up again."""
    _, fine, coarse = meshes
    random = torch.Generator().manual_seed(3)

    def made(mesh, count):
        sizes = [(len(mesh.nodes), 3), (len(np.unique(mesh.outer)),)]
        u, pressure = (0.01 * torch.randn(*size, count, generator=random, dtype=torch.float64) for size in sizes)
        return Unknowns(u.to(device), (pressure.to(device),))

    def depths(*values):
        return torch.tensor(values, dtype=torch.float64, device=device)

    path = CoarsePath.of([(0.1, made(coarse, 1)), (0.3, made(coarse, 1))])
    assert path is not None
    start, every = CoarseStart(path, MeshTransfer(coarse, fine, 1, device)), depths(1, 1, 1) > 0
    starts = Starts(made(fine, 3), sticky=False)
    starts.forget(torch.arange(3, device=device))
    for depth in (0.1, 0.2):
        starts.accept(every, depths(depth, depth, depth), depths(0.1, 0.1, 0.1), every, made(fine, 3))
    guess, near = starts.guess(every, depths(0.2, 0.2, 0.2), depths(0.3, 0.3, 0.1), {0: start, 2: start})
    starts.keep(torch.tensor([2, 0], device=device))
    assert near.tolist() == [0.0, TOUCHING, 0.0]
    return [field.cpu() for field in (guess.u, *guess.multipliers, starts.accepted.u)]


@pytest.mark.parametrize("device", DEVICES)
def test_guesses_are_the_same_on_every_device(meshes, device):
    for ours, theirs in zip(guesses(meshes, device), guesses(meshes, "cpu"), strict=True):
        assert ours.dtype == torch.float64 and ours.abs().max() > 0.01
        assert (ours - theirs).abs().max() < 1e-6


def both_ways(model, requests):
    """States by press, started from the coarser mesh and without it."""
    coarse = model.solve_coarsely(requests, len(requests))
    assert all(one is not None and one.path is not None for one in coarse)
    found = []
    for beside in (coarse, None):
        states = [[] for _ in requests]
        for number, _, state in model.states_many(requests, len(requests), coarse=beside):
            states[number].append(state)
        found.append(states)
    return found


def close(ours, theirs, depth, force=5e-4, moved=2e-4):
    strongest = max(np.abs(state.force).max() for state in theirs)
    for one, other in zip(ours, theirs, strict=True):
        assert np.abs(one.force - other.force).max() < force * strongest
        assert np.abs(one.displacement - other.displacement).max() < moved * depth


@pytest.mark.parametrize("device", DEVICES)
def test_a_start_decides_nothing(meshes, device):
    """Sphere, cylinder and punch with friction, down and up; solved so tightly that only the equation counts."""
    sensor, fine, coarse = meshes
    model = SkinModel(sensor, replace(EXACT, error_estimate=True), device, fine, coarse)
    started, alone = both_ways(model, REQUESTS)
    for request, ours, theirs in zip(REQUESTS, started, alone, strict=True):
        close(ours, theirs, max(request.depths))


@pytest.mark.parametrize("device", DEVICES)
def test_a_start_saves_steps(meshes, device):
    """One in twenty and more, at the tolerance of labels."""
    sensor, fine, coarse = meshes
    spheres = [
        PressRequest(Sphere(2.5), 0.0, 0.1, 0.0, (0.2, 0.5)),
        PressRequest(Sphere(1.0), -0.4, 0.5, 0.0, (0.15, 0.35)),
    ]
    model = SkinModel(sensor, ModelSettings(error_estimate=True), device, fine, coarse)
    ours, theirs = (
        sum(state.newton for one in found for state in one) for found in both_ways(model, REQUESTS + spheres)
    )
    assert ours < 0.95 * theirs


@pytest.mark.long("tacdata/skin", reason="both meshes of the default skin")
def test_tips_on_a_board_start_from_the_coarser_mesh_as_well():
    """The default sensor, to twice what the default tolerance leaves."""
    model = SkinModel(default_sensor())
    [ours], [theirs] = both_ways(model, [PressRequest(Sphere(3.0), 0.3, 0.2, 0.0, (0.1, 0.3))])
    close(ours, theirs, 0.3, force=2e-3, moved=1e-3)
    loads = np.array([[state.taxel_force for state in one] for one in (ours, theirs)])
    assert np.abs(loads[0] - loads[1]).max() < 4e-3 * loads[1].max()
    assert sum(state.newton for state in ours) < sum(state.newton for state in theirs)


def test_newton_steps_are_counted_each(meshes):
    """As many as the batch takes, the first of every load step included."""
    sensor, fine, _ = meshes
    model = SkinModel(sensor, replace(EXACT, error_estimate=False), mesh=fine)
    states = [state for _, state in model.states(REQUESTS[0])]
    assert sum(state.newton for state in states) == model.last_run["ticks"]
    assert all(state.newton > 0 for state in states)
