"""Tractions of a rigid shape on a face: forces, their derivative, and Coulomb's cone."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import batch, box_mesh, joined, random_rotation, slab_sensor

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.sphere import Sphere
from tacdata.sensor.sensor import Material
from tacdata.skin.contact.contact_surface import ContactSurface, face_quadrature
from tacdata.skin.contact.kernels import board_distance
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose, turned

MATERIAL = Material("neo_hookean", 0.30, 0.47)
PENALTY, STICK = 300.0, 30.0
"""As stiffness of the skin [MPa/mm]."""
EYE = torch.eye(3, dtype=torch.float64)[:, :, None]


@pytest.fixture(scope="module")
def mesh():
    return box_mesh(slab_sensor(size=4.0), 6, 6, 2)


class Pressed:
    """A contact with the members' own conditions, so that a test names each thing once."""

    def __init__(self, mesh, *members, distance=None, rough=True):
        nodes, faces = torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer)
        function = distance or Sphere(2.0).distance_function()
        modulus = MATERIAL.youngs_modulus
        self.surface = ContactSurface(nodes, faces, 1, function, rough, PENALTY / modulus, STICK / modulus)
        self.conditions, self.mesh = joined(*members), mesh
        self.weights, _ = face_quadrature(nodes, faces, 1)

        self.start, self.tangent = self.surface.start, 0.0

    def force(self, u, pose, history):
        """Nodal forces; ``now`` keeps the tractions."""
        force, share = torch.zeros_like(u), torch.full_like(self.conditions.modulus, self.tangent)
        self.now = self.surface.add_forces(u, pose, history, self.conditions, share, force)
        return force

    def product(self, p):
        result = torch.zeros_like(p)
        self.surface.add_product(self.now.tangent, p, result)
        return result

    def misfit(self):
        return self.surface.penetration(self.now)

    def flat(self):
        """Displacements of the skin at rest."""
        return batch(*[np.zeros_like(self.mesh.nodes)] * len(self.conditions.modulus))


def against(mesh, friction, shape=None):
    """A sphere, or another shape, of one member."""
    shape = shape or Sphere(2.0)
    return Pressed(mesh, conditions(MATERIAL, friction, shape), distance=shape.distance_function())


def against_board(mesh):
    return Pressed(mesh, conditions(MATERIAL, 0.0), distance=board_distance)


def at(x=0.0, y=0.0, z=0.0, turn=EYE):
    return Pose(torch.tensor([[x], [y], [z]], dtype=torch.float64), turn.clone())


def pose_at(x=0.0, y=0.0, depth=0.1, **angles):
    """Of a shape whose lowest point is ``depth`` below the face; angles [rad]."""
    return at(x, y, 2.0 - depth, turn_by(**angles))


def turn_by(yaw=0.0, tilt_x=0.0, tilt_y=0.0):
    return turned(*(torch.tensor([angle], dtype=torch.float64) for angle in (yaw, tilt_x, tilt_y)))


def everyone(pose):
    return torch.ones(pose.place.shape[1], dtype=torch.bool)


def side_by_side(*poses):
    return Pose(
        torch.cat([pose.place for pose in poses], dim=1).contiguous(),
        torch.cat([pose.turn for pose in poses], dim=2).contiguous(),
    )


def test_quadrature_weights_add_up_to_the_area(mesh):
    weights, shapes = face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer), 2)
    assert weights.sum().item() == pytest.approx(16, rel=1e-12)
    assert shapes.sum(dim=1).numpy() == pytest.approx(np.ones(24))


def test_a_flat_penetration_gives_penalty_times_depth_times_area(mesh):
    """A half-space pushed 0.05 mm into the whole face: pressure and force in closed form."""
    pressed, pose = against_board(mesh), at()
    u = pressed.flat()
    u[:, 2] = -2.05
    force = pressed.force(u, pose, pressed.start(pose))
    assert pressed.now.pressure.numpy() == pytest.approx(np.full(pressed.now.pressure.shape, 0.05 * PENALTY), rel=1e-9)
    assert force[..., 0].sum(dim=0).numpy() == pytest.approx([0, 0, 0.05 * PENALTY * 16], abs=1e-7)
    assert pressed.now.force[:, 0].numpy() == pytest.approx([0, 0, 0.05 * PENALTY * 16], abs=1e-7)
    assert [m.item() for m in pressed.misfit()] == pytest.approx([0.05, 0.05])


def test_a_shape_above_the_face_exerts_nothing(mesh):
    pressed, pose = against(mesh, 0.2), pose_at(depth=-0.01)
    assert not pressed.force(pressed.flat(), pose, pressed.start(pose)).any()
    assert pressed.now.gap.min() > 0 and pressed.misfit()[0].item() == 0
    assert not pressed.now.tangent.touched.any()


def test_a_multiplier_pulls_the_face_no_further_than_its_traction(mesh):
    """Augmented: t = lambda - penalty * gap, so an exact fit carries lambda without penetration."""
    pressed, pose = against_board(mesh), at()
    u = pressed.flat()
    state = pressed.start(pose)
    u[:, 2] = -2.0
    state.multiplier.add_(0.3)
    pressed.force(u, pose, state)
    assert pressed.now.pressure.numpy() == pytest.approx(np.full(pressed.now.pressure.shape, 0.3), abs=1e-9)
    u[:, 2] = -2.0 + 0.3 / PENALTY * 1.01
    assert not pressed.force(u, pose, state).any()


def test_augmenting_takes_the_tractions_of_the_marked_members_alone(mesh):
    pressed = Pressed(mesh, *[conditions(MATERIAL, 0.0, Sphere(2.0))] * 2)
    pose = side_by_side(pose_at(), pose_at())
    state = pressed.start(pose)
    pressed.force(pressed.flat(), pose, state)
    state.augment(pressed.now, torch.tensor([False, True]))
    assert not state.multiplier[..., 0].any()
    assert torch.equal(state.multiplier[..., 1], pressed.now.pressure[..., 1])


@pytest.mark.parametrize("sharp", [0.0, 1.0])
@pytest.mark.parametrize("friction", [0.0, 50.0])
def test_stiffness_is_the_derivative_of_force_where_points_stick_or_slide_freely(mesh, friction, sharp):
    """Without friction or with sticking points the tangent is exact, up to the curvature of the shape times the gap."""
    pressed = against(mesh, friction)
    pose, u = pose_at(0.1, 0.2, 0.02), pressed.flat()
    state = pressed.start(pose)
    pressed.tangent = sharp
    state.gap.zero_()
    pressed.force(u, pose, state)
    state.anchor.copy_(pressed.now.local)
    p, h = batch(np.random.default_rng(1).normal(size=mesh.nodes.shape)), 1e-7
    difference = (pressed.force(u + h * p, pose, state) - pressed.force(u - h * p, pose, state)) / (2 * h)
    pressed.force(u, pose, state)
    assert (pressed.product(p) + difference).abs().max() < 0.04 * difference.abs().max()


def test_the_stiffness_of_the_faces_is_that_of_the_product(mesh):
    """Blocks are in single precision, as the preconditioner wants them."""
    pressed = against(mesh, 0.3)
    pose, u = pose_at(), pressed.flat()
    pressed.force(u, pose, pressed.start(pose_at(depth=0.0)))
    p = batch(np.random.default_rng(2).normal(size=mesh.nodes.shape))
    product, assembled = pressed.product(p), torch.zeros_like(p)
    every = torch.arange(len(mesh.outer))
    blocks = pressed.surface.face_stiffness(pressed.now.tangent, every, torch.zeros_like(every)).double()
    for nodes, block in zip(mesh.outer, blocks, strict=True):
        assembled[nodes, :, 0] += (block @ p[nodes, :, 0].reshape(-1)).reshape(6, 3)
    assert product.abs().max() > 1
    assert (product - assembled).abs().max() < 1e-6 * product.abs().max()
    untouched = ~pressed.now.tangent.touched[:, 0]
    assert untouched.any() and not blocks[untouched].any()


def test_the_product_in_single_precision_is_that_in_double(mesh):
    pressed = against(mesh, 0.3)
    pose, u = pose_at(), pressed.flat()
    pressed.force(u, pose, pressed.start(pose_at(depth=0.0)))
    p = batch(np.random.default_rng(2).normal(size=mesh.nodes.shape))
    product, single = pressed.product(p), pressed.product(p.float())
    assert single.dtype == torch.float32
    assert (single.double() - product).abs().max() < 1e-6 * product.abs().max()


def drag(mesh, friction, shift):
    """Press 0.05 mm deep, accept, move the shape sideways; return normal and tangential traction of each point."""
    pressed = against(mesh, friction)
    u, before = pressed.flat(), pose_at(depth=0.05)
    state = pressed.start(before)
    pressed.force(u, before, state)
    state.accept(pressed.now, before, everyone(before))
    pressed.force(u, pose_at(x=shift, depth=0.05), state)
    carries = pressed.now.pressure[..., 0] > 0
    return pressed.now.pressure[..., 0][carries].numpy(), pressed.now.shear[..., 0][carries].numpy()


def test_a_small_shift_sticks_with_the_tangential_stiffness(mesh):
    pressure, shear = drag(mesh, 10.0, 1e-3)
    assert len(pressure) > 10
    assert shear[:, 0] == pytest.approx(np.full(len(shear), STICK * 1e-3), rel=0.05)


def test_a_large_shift_slides_on_coulombs_cone_along_the_motion(mesh):
    pressure, shear = drag(mesh, 0.05, 0.05)
    size = np.linalg.norm(shear, axis=1)
    assert np.all(size <= 0.05 * pressure * (1 + 1e-12))
    sliding = size > 0.05 * pressure * (1 - 1e-9)
    assert sliding.mean() > 0.9
    assert (shear[:, 0] > 0).all()


def test_friction_comes_back_with_the_shape(mesh):
    """Dragged to and fro by the same distance, sliding points end with the opposite traction."""
    there, back = drag(mesh, 0.05, 0.05)[1], drag(mesh, 0.05, -0.05)[1]
    assert there[:, 0].mean() == pytest.approx(-back[:, 0].mean(), rel=0.05)


def test_accepting_leaves_the_unmarked_member_with_its_history(mesh):
    pressed = Pressed(mesh, *[conditions(MATERIAL, 0.2, Sphere(2.0))] * 2)
    pose = side_by_side(pose_at(), pose_at())
    state = pressed.start(pose)
    before = state.copy()
    pressed.force(pressed.flat(), pose, state)
    state.accept(pressed.now, pose, torch.tensor([True, False]))
    assert torch.equal(state.gap[..., 1], before.gap[..., 1]) and not state.anchor[..., 1].any()
    assert state.gap[..., 0].isfinite().all() and (state.gap[..., 0] == 0).any()


def test_yaw_turns_the_shape_about_its_tip(mesh):
    """A sphere has no direction: turning it changes nothing; its force follows its place."""
    pressed = against(mesh, 0.0)
    plain, turned_ = (
        pressed.force(pressed.flat(), pose, pressed.start(pose))
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
    upright, leaning = (pressed.force(pressed.flat(), pose, pressed.start(pose)) for pose in (plain, tilted))
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
        pressed.force(field, poses[0], state)
        state.accept(pressed.now, poses[0], everyone(poses[0]))
        force = pressed.force(field, poses[1], state)
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
    together = whole.force(whole.flat(), side_by_side(*poses), whole.start(side_by_side(*start)))
    p = np.random.default_rng(3).normal(size=mesh.nodes.shape)
    product = whole.product(batch(p, p, p))
    for column, (member, pose, before) in enumerate(zip(members, poses, start, strict=True)):
        alone = Pressed(mesh, member)
        force = alone.force(alone.flat(), pose, alone.start(before))
        assert force.abs().max() > 1e-3
        assert (force[..., 0] - together[..., column]).abs().max() < 1e-13 * force.abs().max()
        assert (alone.product(batch(p))[..., 0] - product[..., column]).abs().max() < 1e-12 * product.abs().max()
        assert whole.now.force[:, column].numpy() == pytest.approx(alone.now.force[:, 0].numpy())
        largest, mean = (m[column].item() for m in whole.misfit())
        assert (largest, mean) == pytest.approx(tuple(m.item() for m in alone.misfit()), rel=1e-12)


def test_tractions_are_proportional_to_the_members_modulus(mesh):
    soft, stiff = (conditions(replace(MATERIAL, youngs_modulus=e), 0.2, Sphere(2.0)) for e in (0.2, 0.8))
    pressed, pose = Pressed(mesh, soft, stiff), side_by_side(pose_at(0.1), pose_at(0.1))
    force = pressed.force(pressed.flat(), pose, pressed.start(side_by_side(pose_at(), pose_at())))
    assert (4 * force[..., 0] - force[..., 1]).abs().max() < 1e-12 * force.abs().max()


def test_a_thicker_members_face_lies_higher(mesh):
    """A slab 1.1 times as thick is touched 0.2 mm further up."""
    thick = conditions(MATERIAL, 0.0, Sphere(2.0), thickness=1.1)
    plain, raised = against(mesh, 0.0), Pressed(mesh, thick)
    low, high = pose_at(0.1, 0.2, 0.1), pose_at(0.1, 0.2, 0.1 - 0.2)
    one = plain.force(plain.flat(), low, plain.start(low))
    other = raised.force(raised.flat(), high, raised.start(high))
    assert one.abs().max() > 0.1
    assert (one - other).abs().max() < 1e-9 * one.abs().max()
