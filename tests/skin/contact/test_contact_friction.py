"""Coulomb friction at nodes: sticking, slipping, coming back, and its stiffness."""

import numpy as np
import pytest
import torch
from pressed_face import STICK, against, against_board, at, everyone, pose_at, slab_mesh
from skin_examples import batch


@pytest.fixture(scope="module")
def mesh():
    return slab_mesh()


def slipping(mesh, tangent):
    """A board on which all nodes slip: pressures and slips differ."""
    pressed, pose = against_board(mesh, 0.2), at()
    pressed.tangent = tangent
    u, state = pressed.flat(0.0), pressed.start(pose)
    state.gap.zero_()
    multiplier = 0.1 + 0.02 * torch.as_tensor(np.random.default_rng(4).random((pressed.surface.count, 1)))
    pressed.force(u, pose, state, multiplier)
    slip = torch.as_tensor(np.random.default_rng(5).uniform(0.002, 0.004, size=(pressed.surface.count, 3, 1)))
    state.anchor.copy_(pressed.now.local + slip)
    pressed.force(u, pose, state, multiplier)
    size = pressed.now.shear.norm(dim=1)
    assert torch.allclose(size, 0.2 * multiplier, rtol=1e-12)
    return pressed, (u, pose, state, multiplier)


def test_the_tangent_of_slipping_nodes_is_the_derivative_of_force(mesh):
    pressed, state = slipping(mesh, 1.0)
    p = batch(np.random.default_rng(1).normal(size=mesh.nodes.shape))
    difference = pressed.slope(*state, p, 1e-6)
    assert (pressed.product(p) + difference).abs().max() < 1e-6 * difference.abs().max()


def test_the_secant_of_slipping_nodes_is_stiffer_than_the_tangent(mesh):
    tangent, secant = (slipping(mesh, share)[0] for share in (1.0, 0.0))
    for seed in range(5):
        p = batch(np.random.default_rng(seed).normal(size=mesh.nodes.shape))
        by_tangent, by_secant = ((p * one.product(p)).sum().item() for one in (tangent, secant))
        assert 0 < by_tangent < by_secant
    # Along the normal friction does nothing.
    upward = torch.zeros(len(mesh.nodes), 3, 1, dtype=torch.float64)
    upward[:, 2] = 1.0
    assert not secant.product(upward).any() and not tangent.product(upward).any()


class Dragged:
    """A board that presses with 0.3 MPa all over, moved from place to place; every place is accepted."""

    def __init__(self, mesh, friction):
        self.pressed = against_board(mesh, friction)
        self.state = self.pressed.start(at())
        self.to(0.0)

    def to(self, x):
        """Shear traction of all nodes when the board has moved to ``x`` [mm], shape (s, 3)."""
        pose = at(x)
        self.pressed.force(self.pressed.flat(0.0), pose, self.state, self.pressed.even(0.3))
        self.state.accept(self.pressed.now, pose, everyone(pose))
        return self.pressed.now.shear[..., 0].numpy()

    @property
    def count(self):
        return self.pressed.surface.count


def test_a_small_shift_sticks_with_the_tangential_stiffness(mesh):
    board = Dragged(mesh, 10.0)
    shear = board.to(1e-3)
    assert shear[:, 0] == pytest.approx(np.full(board.count, STICK * 1e-3), rel=1e-9)
    assert not shear[:, 1:].any()
    assert board.pressed.now.force[:, 0].numpy() == pytest.approx([STICK * 1e-3 * 16, 0, 0.3 * 16], abs=1e-9)


def test_a_large_shift_slides_on_coulombs_disc_and_comes_back_along_a_loop(mesh):
    """Friction 0.05 of 0.3 MPa is 0.015 MPa. A way of 1e-4 mm back takes 0.003 MPa off; a long one turns it round."""
    board = Dragged(mesh, 0.05)
    for x, wanted in ((0.05, 0.015), (0.05 - 1e-4, 0.012), (0.0, -0.015)):
        shear = board.to(x)
        assert shear[:, 0] == pytest.approx(np.full(board.count, wanted), rel=1e-9)
        assert board.pressed.now.force[0, 0].item() == pytest.approx(16 * wanted, rel=1e-9)


def test_a_node_that_is_reached_on_the_way_slips_only_from_then_on(mesh):
    """A gap of 0.02 mm before, 0.08 mm closer now: it is closed for three quarters of the way of 1e-3 mm."""
    pressed, before, now = against_board(mesh, 10.0), at(), at(x=1e-3, z=0.08)
    state, u = pressed.start(before), pressed.flat(0.02)
    pressed.force(u, before, state, pressed.even(0.0))
    state.accept(pressed.now, before, everyone(before))
    pressed.force(u, now, state, pressed.even(0.3))
    shear = pressed.now.shear[:, 0, 0].numpy()
    assert shear == pytest.approx(np.full(len(shear), 0.75 * STICK * 1e-3), rel=1e-9)


def drag(mesh, friction, shift):
    """Press 0.05 mm deep, accept, move the shape sideways; return pressure and shear traction of each node."""
    pressed = against(mesh, friction)
    u, before = pressed.flat(), pose_at(depth=0.05)
    state = pressed.start(before)
    pressed.press(u, before, state)
    state.accept(pressed.now, before, everyone(before))
    pressed.press(u, pose_at(x=shift, depth=0.05), state)
    carries = pressed.now.pressure[..., 0] > 0
    return pressed.now.pressure[..., 0][carries].numpy(), pressed.now.shear[..., 0][carries].numpy()


def test_no_node_under_a_sphere_leaves_coulombs_disc(mesh):
    pressure, shear = drag(mesh, 0.05, 0.05)
    size = np.linalg.norm(shear, axis=1)
    assert np.all(size <= 0.05 * pressure * (1 + 1e-12))
    sliding = size > 0.05 * pressure * (1 - 1e-9)
    assert len(pressure) >= 5 and sliding.mean() > 0.9
    assert (shear[:, 0] > 0).all()


@pytest.mark.parametrize(("friction", "what"), [(0.05, 2), (5.0, 1), (0.0, 1)])
def test_a_node_is_open_sticks_or_slips(mesh, friction, what):
    """Dragged by 0.05 mm; without friction a node that touches is said to stick."""
    pressed = against(mesh, friction)
    u, before = pressed.flat(), pose_at(depth=0.05)
    state = pressed.start(before)
    pressed.press(u, before, state)
    state.accept(pressed.now, before, everyone(before))
    pressed.press(u, pose_at(x=0.01 if friction > 1 else 0.05, depth=0.05), state)
    status = pressed.surface.status(pressed.now, pressed.conditions.friction)[:, 0]
    touching = pressed.now.pressure[:, 0] > 0
    assert touching.any() and not status[~touching].any()
    assert (status[touching] == what).double().mean() > 0.9


def test_dragged_to_and_fro_friction_under_a_sphere_is_opposite(mesh):
    there, back = drag(mesh, 0.05, 0.05)[1], drag(mesh, 0.05, -0.05)[1]
    assert there[:, 0].mean() == pytest.approx(-back[:, 0].mean(), rel=0.05)
