"""Tractions of a rigid shape on a face: forces, their derivative, and Coulomb's cone."""

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact import Contact, board_distance, face_quadrature

PENALTY, STICK = 300.0, 30.0
ORIGIN = torch.zeros(1, 4, dtype=torch.float64)


@pytest.fixture(scope="module")
def mesh():
    return box_mesh(slab_sensor(size=4.0), 6, 6, 2)


def contact_with(mesh, friction, distance=None, parameters=(2.0,)):
    nodes, faces = torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer)
    weights, shapes = face_quadrature(nodes, faces, 1)
    function = distance or Sphere(2.0).distance_function()
    return Contact(nodes, faces, weights, shapes, function, parameters, friction, PENALTY, STICK)


def pose_at(x=0.0, y=0.0, depth=0.1, yaw=0.0):
    return torch.tensor([[x, y, 2.0 - depth, yaw]], dtype=torch.float64)


def zeros(mesh):
    return torch.zeros(1, *mesh.nodes.shape, dtype=torch.float64)


def force_on(contact, mesh, u, pose, state):
    force = zeros(mesh)
    contact.add_force(u, pose, state, force)
    return force


def test_quadrature_weights_add_up_to_the_area(mesh):
    weights, shapes = face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer), 2)
    assert weights.sum().item() == pytest.approx(16, rel=1e-12)
    assert shapes.sum(dim=1).numpy() == pytest.approx(np.ones(24))


def test_a_flat_penetration_gives_penalty_times_depth_times_area(mesh):
    """A half-space pushed 0.05 mm into the whole face: pressure and force in closed form."""
    contact = contact_with(mesh, 0.0, board_distance, ())
    u = zeros(mesh)
    u[0, :, 2] = -2.05
    force = force_on(contact, mesh, u, ORIGIN, contact.start(ORIGIN))
    assert contact.pressure.numpy() == pytest.approx(np.full(contact.pressure.shape, 0.05 * PENALTY), rel=1e-9)
    assert force[0].sum(dim=0).numpy() == pytest.approx([0, 0, 0.05 * PENALTY * 16], abs=1e-7)
    assert contact.misfit().item() == pytest.approx(0.05)


def test_a_shape_above_the_face_exerts_nothing(mesh):
    contact = contact_with(mesh, 0.2)
    pose = pose_at(depth=-0.01)
    assert not force_on(contact, mesh, zeros(mesh), pose, contact.start(pose)).any()
    assert contact.gap.min() > 0 and contact.misfit().item() == 0


def test_a_multiplier_pulls_the_face_no_further_than_its_traction(mesh):
    """Augmented: t = lambda - penalty * gap, so an exact fit carries lambda without penetration."""
    contact = contact_with(mesh, 0.0, board_distance, ())
    state = contact.start(ORIGIN)
    u = zeros(mesh)
    u[0, :, 2] = -2.0
    state.multiplier += 0.3
    force_on(contact, mesh, u, ORIGIN, state)
    assert contact.pressure.numpy() == pytest.approx(np.full(contact.pressure.shape, 0.3), abs=1e-9)
    u[0, :, 2] = -2.0 + 0.3 / PENALTY * 1.01
    assert not force_on(contact, mesh, u, ORIGIN, state).any()


@pytest.mark.parametrize("sharp", [0.0, 1.0])
@pytest.mark.parametrize("friction", [0.0, 50.0])
def test_stiffness_is_the_derivative_of_force_where_points_stick_or_slide_freely(mesh, friction, sharp):
    """Without friction or with sticking points the tangent is exact, up to the curvature of the shape times the gap."""
    contact = contact_with(mesh, friction)
    contact.sharp = sharp
    pose, u = pose_at(0.1, 0.2, 0.02), zeros(mesh)
    state = contact.start(pose)
    state.gap.zero_()
    state.anchor.copy_(torch.as_tensor(contact_places(contact, mesh, u, pose, state)))
    p, h = torch.as_tensor(np.random.default_rng(1).normal(size=(1, *mesh.nodes.shape))), 1e-7
    difference = (
        force_on(contact, mesh, u + h * p, pose, state) - force_on(contact, mesh, u - h * p, pose, state)
    ) / (2 * h)
    force_on(contact, mesh, u, pose, state)
    product = zeros(mesh)
    contact.add_product(p, product)
    assert (product + difference).abs().max() < 0.04 * difference.abs().max()


def contact_places(contact, mesh, u, pose, state):
    force_on(contact, mesh, u, pose, state)
    return contact.place.clone()


def test_the_stiffness_of_the_faces_is_that_of_the_product(mesh):
    contact = contact_with(mesh, 0.3)
    pose, u = pose_at(), zeros(mesh)
    state = contact.start(pose_at(depth=0.0))
    force_on(contact, mesh, u, pose, state)
    p = torch.as_tensor(np.random.default_rng(2).normal(size=(1, *mesh.nodes.shape)))
    product, assembled = zeros(mesh), zeros(mesh)
    contact.add_product(p, product)
    blocks = contact.face_stiffness(torch.arange(len(mesh.outer)))
    for nodes, block in zip(mesh.outer, blocks, strict=True):
        assembled[0, nodes] += (block @ p[0, nodes].reshape(-1)).reshape(6, 3)
    assert product.abs().max() > 1
    assert (product - assembled).abs().max() < 1e-11 * product.abs().max()


def drag(mesh, friction, shift):
    """Press 0.05 mm deep, accept, move the shape sideways; return normal and tangential traction of each point."""
    contact, u = contact_with(mesh, friction), zeros(mesh)
    before = pose_at(depth=0.05)
    state = contact.start(before)
    force_on(contact, mesh, u, before, state)
    contact.accept(state, before)
    force_on(contact, mesh, u, pose_at(x=shift, depth=0.05), state)
    carries = contact.pressure > 0
    return contact.pressure[carries].numpy(), contact.shear[carries].numpy()


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


def test_yaw_turns_the_shape_about_its_tip(mesh):
    """A sphere has no direction: turning it changes nothing; its force follows its place."""
    contact = contact_with(mesh, 0.0)
    plain, turned = (
        force_on(contact, mesh, zeros(mesh), pose, contact.start(pose))
        for pose in (pose_at(0.3, 0.1), pose_at(0.3, 0.1, yaw=1.1))
    )
    assert (plain - turned).abs().max() < 1e-7 * plain.abs().max()
    weight = -plain[0, :, 2].numpy()
    assert weight.sum() > 0
    assert weight @ mesh.nodes[:, :2] / weight.sum() == pytest.approx([0.3, 0.1], abs=0.02)
