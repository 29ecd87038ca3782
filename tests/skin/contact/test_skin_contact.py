"""Nodal pressures of a rigid shape on a face: mean gaps, forces, their derivative, the active set, invariance."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from pressed_face import (
    MATERIAL,
    SPACING,
    Pressed,
    against,
    against_board,
    at,
    everyone,
    pose_at,
    side_by_side,
    slab_mesh,
    turn_by,
)
from skin_examples import DEVICES, batch, random_rotation

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.ring import Ring
from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.contact_surface import ContactSurface, face_quadrature
from tacdata.skin.member.conditions import Conditions, conditions, shape_number
from tacdata.skin.member.pose import Pose


@pytest.fixture(scope="module")
def mesh():
    return slab_mesh()


def inside(pressed):
    """Contact nodes away from the rim, whose hats are whole, and their places."""
    places = pressed.mesh.nodes[pressed.surface.mortar.nodes]
    which = np.abs(places[:, :2]).max(axis=1) < 2 - 1e-9
    return which, places[which]


def test_quadrature_weights_add_up_to_the_area(mesh):
    weights, shapes = face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer), 2)
    assert weights.sum().item() == pytest.approx(16, rel=1e-12)
    assert shapes.sum(dim=1).numpy() == pytest.approx(np.ones(24))


def test_a_pressure_pushes_with_pressure_times_area_whatever_the_penetration(mesh):
    """A half-space 0.05 mm beyond the face: the gap, its misfit, and the forces of 0.3 MPa in closed form."""
    pressed, pose = against_board(mesh), at()
    force = pressed.force(pressed.flat(-0.05), pose, pressed.start(pose), pressed.even(0.3))
    assert pressed.now.gap.numpy() == pytest.approx(np.full(pressed.now.gap.shape, -0.05), rel=1e-9)
    assert pressed.now.force[:, 0].numpy() == pytest.approx([0, 0, 0.3 * 16], abs=1e-12)
    assert pressed.misfit() == [pytest.approx([0.05]), pytest.approx([0.05])]
    # The integral of a quadratic triangle's shape functions: none at corners, a third of the area at mid-sides.
    wanted = np.zeros(len(mesh.nodes))
    np.add.at(wanted, mesh.outer[:, 3:], 0.3 * 16 / len(mesh.outer) / 3)
    assert force[:, 2, 0].numpy() == pytest.approx(wanted, abs=1e-12) and not force[:, :2].any()


def test_pressures_that_rise_linearly_tilt_by_their_moment(mesh):
    """Hats hold p = 0.3 + 0.05 x exactly: resultant 0.3 * 16 N, moment 0.05 * 4^4 / 12 N mm."""
    pressed, pose = against_board(mesh), at()
    x = torch.as_tensor(mesh.nodes[pressed.surface.mortar.nodes, 0])
    force = pressed.force(pressed.flat(0.0), pose, pressed.start(pose), (0.3 + 0.05 * x)[:, None])[:, 2, 0].numpy()
    assert force.sum() == pytest.approx(0.3 * 16, rel=1e-12)
    assert force @ mesh.nodes[:, 0] == pytest.approx(0.05 * 4**4 / 12, rel=1e-12)
    assert force @ mesh.nodes[:, 1] == pytest.approx(0, abs=1e-12)


def test_the_mean_gap_to_a_leaning_plane_is_that_at_the_middle_of_the_hat(mesh):
    pressed, turn = against_board(mesh), turn_by(0.4, 0.2, -0.1)
    pose = at(0.3, -0.2, 1.9, turn)
    pressed.force(pressed.flat(), pose, pressed.start(pose), pressed.even(0.0))
    which, places = inside(pressed)
    wanted = (places - [0.3, -0.2, 1.9]) @ turn[:, 2, 0].numpy()
    assert wanted.min() < -0.2 and wanted.max() > 0.3
    assert pressed.now.gap[which, 0].numpy() == pytest.approx(wanted, abs=1e-12)


def test_the_mean_gap_to_a_sphere_is_that_of_a_paraboloid_under_the_hat(mesh):
    """The hat of a regular lattice varies by h^2 / 6 along each axis: by r^2 / 2 R the mean gap is h^2 / 6 R larger."""
    shape = Sphere(200.0)
    pressed, pose = against(mesh, 0.0, shape), pose_at(depth=0.02)
    pressed.force(pressed.flat(), pose, pressed.start(pose), pressed.even(0.0))
    which, places = inside(pressed)
    wanted = -0.02 + ((places[:, :2] ** 2).sum(axis=1) + SPACING**2 / 3) / 400
    # What the paraboloid leaves out of the sphere is below r^4 / 8 R^3 and the slant, some 1e-6 mm.
    assert pressed.now.gap[which, 0].numpy() == pytest.approx(wanted, abs=2e-6)


def test_a_shape_above_the_face_exerts_nothing(mesh):
    pressed, pose = against(mesh, 0.2), pose_at(depth=-0.01)
    assert not pressed.force(pressed.flat(), pose, pressed.start(pose), pressed.even(0.0)).any()
    assert pressed.now.gap.min() > 0 and pressed.misfit()[0] == [0.0]
    assert not pressed.now.tangent.active.any()


@pytest.mark.parametrize(
    ("gap", "near", "multiplier", "active"),
    [
        (0.01, 0.0, 0.0301, True),
        (0.01, 0.0, 0.0299, False),
        (-0.01, 0.0, -0.0299, True),
        (-0.01, 0.0, -0.0301, False),
        (0.01, 0.02, 0.0, True),
        (0.03, 0.02, 0.0, False),
    ],
)
def test_nodes_are_active_where_the_multiplier_outweighs_the_gap(mesh, gap, near, multiplier, active):
    """By 10 times a modulus of 0.3 MPa: at 0.01 mm it takes 0.03 MPa. Held nodes never are; others carry nothing."""
    held = mesh.nodes[:, 0] < -2 + 1e-9
    pressed, pose = against_board(mesh, held=held), at()
    pressed.near = near
    force = pressed.force(pressed.flat(gap), pose, pressed.start(pose), pressed.even(multiplier))
    able = ~held[pressed.surface.mortar.nodes]
    assert 0 < able.sum() < len(able)
    assert pressed.now.tangent.active[:, 0].numpy().tolist() == (able & active).tolist()
    assert pressed.now.pressure[:, 0].numpy() == pytest.approx(np.where(able & active, multiplier, 0.0))
    assert active or not force.any()


def test_misfit_counts_gaps_under_pressure_and_penetration_elsewhere(mesh):
    """Half of the face is loaded. A gap of 0.05 mm is an error there alone; a penetration is one everywhere."""
    pressed, pose = against_board(mesh), at()
    loaded = torch.as_tensor(mesh.nodes[pressed.surface.mortar.nodes, 0] > 0)[:, None]
    for height, multiplier, wanted in (
        (0.05, torch.where(loaded, 0.3, 0.0), (0.05, 0.05)),
        (0.05, pressed.even(0.0), (0.0, 0.0)),
        (-0.05, pressed.even(0.0), (0.05, 0.0)),
    ):
        pressed.force(pressed.flat(height), pose, pressed.start(pose), multiplier.double())
        assert [value[0] for value in pressed.misfit()] == pytest.approx(wanted)


@pytest.mark.parametrize("friction", [0.0, 50.0])
@pytest.mark.parametrize("shape", [Sphere(2.0), Cylinder(1.5, 3.0, 0.4)])
def test_stiffness_is_the_derivative_of_force_as_normals_turn_and_points_stick(mesh, friction, shape):
    """At fixed multipliers forces turn with the normals, and sticking nodes resist; both are in the product."""
    pressed, pose = against(mesh, friction, shape), pose_at(0.1, 0.2, 0.1, yaw=0.3)
    u, state = pressed.flat(), pressed.start(pose)
    state.gap.zero_()
    pressed.press(u, pose, state)
    state.anchor.copy_(pressed.now.local)
    p = batch(np.random.default_rng(1).normal(size=mesh.nodes.shape))
    difference = pressed.slope(u, pose, state, pressed.multiplier, p, 1e-5)
    assert difference.abs().max() > 1e-2
    assert (pressed.product(p) + difference).abs().max() < 1e-4 * difference.abs().max()


def test_the_product_in_single_precision_is_that_in_double(mesh):
    pressed = against(mesh, 0.3)
    pose, u = pose_at(), pressed.flat()
    pressed.press(u, pose, pressed.start(pose_at(depth=0.0)))
    p = batch(np.random.default_rng(2).normal(size=mesh.nodes.shape))
    product, single = pressed.product(p), pressed.product(p.float())
    assert single.dtype == torch.float32 and product.abs().max() > 1e-2
    assert (single.double() - product).abs().max() < 1e-6 * product.abs().max()


def test_accepting_leaves_the_unmarked_member_with_its_history(mesh):
    pressed = Pressed(mesh, *[conditions(MATERIAL, 0.2, Sphere(2.0))] * 2)
    pose = side_by_side(pose_at(), pose_at())
    state = pressed.start(pose)
    before = state.copy()
    pressed.press(pressed.flat(), pose, state)
    state.accept(pressed.now, pose, torch.tensor([True, False]))
    assert torch.equal(state.gap[..., 1], before.gap[..., 1]) and not state.anchor[..., 1].any()
    assert state.gap[..., 0].isfinite().all() and (state.gap[..., 0] == 0).any()


def test_yaw_turns_the_shape_about_its_tip(mesh):
    """A sphere has no direction: turning it changes nothing; its force follows its place."""
    pressed = against(mesh, 0.0)
    plain, turned_ = (
        pressed.press(pressed.flat(), pose, pressed.start(pose))
        for pose in (pose_at(0.3, 0.1), pose_at(0.3, 0.1, yaw=1.1))
    )
    assert (plain - turned_).abs().max() < 1e-7 * plain.abs().max()
    weight = -plain[:, 2, 0].numpy()
    assert weight.sum() > 0
    assert weight @ mesh.nodes[:, :2] / weight.sum() == pytest.approx([0.3, 0.1], abs=0.02)


def test_a_sphere_tilted_about_its_centre_presses_the_same(mesh):
    """A tilt turns about the origin, the lowest point upright; moved so that the centre stays, nothing changes."""
    pressed, plain, tilt = against(mesh, 0.0), pose_at(0.3, 0.1), turn_by(0.4, 0.3, -0.2)
    centre = plain.place + torch.tensor([[0.0], [0.0], [2.0]])
    tilted = Pose((centre - 2.0 * tilt[:, 2]).contiguous(), tilt)
    upright, leaning = (pressed.press(pressed.flat(), pose, pressed.start(pose)) for pose in (plain, tilted))
    assert (tilted.place - plain.place).abs().max() > 0.3
    assert upright.abs().max() > 0.1
    assert (upright - leaning).abs().max() < 1e-7 * upright.abs().max()


@pytest.mark.parametrize("shape", [Sphere(2.0), Cylinder(1.5, 3.0, 0.4)])
def test_an_observer_who_turns_sees_the_forces_turned(mesh, shape):
    """Objectivity: skin, shape and its motion turned together turn the forces, friction and stiffness included."""
    Q = random_rotation(np.random.default_rng(11))
    shift = np.array([0.3, -0.4, 5.0])
    other = replace(mesh, nodes=mesh.nodes @ Q.T + shift)
    u = 0.01 * np.sin(mesh.nodes @ np.random.default_rng(12).uniform(-1, 1, (3, 3)))
    p = np.random.default_rng(13).normal(size=mesh.nodes.shape)

    def seen(on, turn, moved):
        pressed = against(on, 0.2, shape)
        poses = [
            Pose(
                (turn @ pose.place + moved[:, None]).contiguous(),
                torch.einsum("ij,jkb->ikb", turn, pose.turn).contiguous(),
            )
            for pose in (pose_at(0.1, -0.2, 0.1, yaw=0.3), pose_at(0.13, -0.22, 0.12, yaw=0.3))
        ]
        state = pressed.start(poses[0])
        field, along = (batch(value @ turn.numpy().T) for value in (u, p))
        pressed.press(field, poses[0], state)
        state.accept(pressed.now, poses[0], everyone(poses[0]))
        force = pressed.press(field, poses[1], state)
        return force[..., 0] @ turn, pressed.product(along)[..., 0] @ turn, pressed.now.shear

    one = seen(mesh, torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))
    two = seen(other, torch.as_tensor(Q), torch.as_tensor(shift))
    assert one[2].abs().max() > 0.01
    for here, there in zip(one, two, strict=True):
        assert (here - there).abs().max() < 1e-6 * here.abs().max()


def test_every_member_has_its_own_shape_friction_modulus_and_pose(mesh):
    """Side by side as alone."""
    members = [
        conditions(MATERIAL, 0.0, Sphere(2.0)),
        conditions(MATERIAL, 0.3, Sphere(1.0)),
        conditions(replace(MATERIAL, youngs_modulus=0.6), 0.1, Sphere(3.0)),
    ]
    poses = [pose_at(0.1, 0.2, 0.1), pose_at(-0.5, 0.0, 0.05), pose_at(0.0, 0.4, 0.15)]
    start = [pose_at(pose.place[0].item(), pose.place[1].item(), 0.0) for pose in poses]
    whole = Pressed(mesh, *members)
    together = whole.press(whole.flat(), side_by_side(*poses), whole.start(side_by_side(*start)))
    p = np.random.default_rng(3).normal(size=mesh.nodes.shape)
    product = whole.product(batch(p, p, p))
    for column, (member, pose, before) in enumerate(zip(members, poses, start, strict=True)):
        alone = Pressed(mesh, member)
        force = alone.press(alone.flat(), pose, alone.start(before))
        assert force.abs().max() > 1e-3
        assert (force[..., 0] - together[..., column]).abs().max() < 1e-13 * force.abs().max()
        assert (alone.product(batch(p))[..., 0] - product[..., column]).abs().max() < 1e-12 * product.abs().max()
        assert whole.now.force[:, column].numpy() == pytest.approx(alone.now.force[:, 0].numpy())
        largest, mean = (m[column] for m in whole.misfit())
        assert (largest, mean) == pytest.approx(tuple(m[0] for m in alone.misfit()), rel=1e-12)


def test_tractions_are_proportional_to_the_members_modulus(mesh):
    soft, stiff = (conditions(replace(MATERIAL, youngs_modulus=e), 0.2, Sphere(2.0)) for e in (0.2, 0.8))
    pressed, pose = Pressed(mesh, soft, stiff), side_by_side(pose_at(0.1), pose_at(0.1))
    force = pressed.press(pressed.flat(), pose, pressed.start(side_by_side(pose_at(), pose_at())))
    assert (4 * force[..., 0] - force[..., 1]).abs().max() < 1e-12 * force.abs().max()


def test_a_thicker_members_face_lies_higher(mesh):
    """A slab 1.1 times as thick is touched 0.2 mm further up."""
    thick = conditions(MATERIAL, 0.0, Sphere(2.0), thickness=1.1)
    plain, raised = against(mesh, 0.0), Pressed(mesh, thick)
    low, high = pose_at(0.1, 0.2, 0.1), pose_at(0.1, 0.2, 0.1 - 0.2)
    one = plain.press(plain.flat(), low, plain.start(low))
    other = raised.press(raised.flat(), high, raised.start(high))
    assert one.abs().max() > 0.1
    assert (one - other).abs().max() < 1e-9 * one.abs().max()


def test_skin_above_a_shape_is_told(mesh):
    """A sphere of 0.8 mm radius beneath a flat face: touching, sunk to its middle, three quarters in, swallowed."""
    shape = Sphere(0.8)
    pressed = against(mesh, 0.0, shape)
    found = [
        pressed.surface.passed_through(pressed.flat(), pose_at(depth=depth), pressed.conditions).item()
        for depth in (0.1, 0.8, 1.2, 1.9)
    ]
    assert found == [False, False, True, True]


@pytest.mark.parametrize("device", DEVICES)
def test_members_are_told_apart_by_shape_on_every_device(mesh, device):
    """Two shapes in one batch, each touching and swallowed, and a shape that waits far above."""
    shapes = [Sphere(0.8), Ring(1.0, 0.4), Sphere(0.8), Ring(1.0, 0.4), Ring(1.0, 0.4)]
    nodes, faces = torch.as_tensor(mesh.nodes, device=device), torch.as_tensor(mesh.outer, device=device)
    own = Conditions.joined([conditions(MATERIAL, 0.2, shape, device=device) for shape in shapes])
    distances = {shape_number(shape): shape.distance_function() for shape in shapes}
    surface = ContactSurface(nodes, faces, torch.zeros_like(nodes[:, 0]) > 0, distances, True, 10.0, 30.0)
    pose = side_by_side(*(pose_at(depth=depth) for depth in (0.1, 0.2, 1.9, 1.0, -1e3)))
    pose = Pose(pose.place.to(device), pose.turn.to(device))
    u = torch.zeros(len(nodes), 3, len(shapes), dtype=torch.float64, device=device)
    assert surface.passed_through(u, pose, own).tolist() == [False, False, True, True, False]


def test_a_leaning_flank_is_not_taken_for_skin_above_the_shape(mesh):
    """A pin's face lies flat beside it: at 30 degrees, the most that is allowed, points lie above its flank."""
    shape = Cylinder(radius=0.5, length=3.0, edge_radius=0.1)
    pressed = against(mesh, 0.0, shape)
    pose = pose_at(depth=0.4, tilt_x=np.radians(30.0))
    assert not pressed.surface.passed_through(pressed.flat(), pose, pressed.conditions).item()
