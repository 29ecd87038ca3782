"""The constraint preconditioner: exact for the body at rest with its contact constraints, whoever solves with them."""

import numpy as np
import pytest
import torch
from contact_examples import PressedSlab
from skin_examples import MATERIAL, HeldSlab

from tacdata.skin.linear import constraint_preconditioner
from tacdata.skin.linear.batched_inverse import inverse_of
from tacdata.skin.linear.constraint_solvers import FactoredCompliance, InvertedCompliance
from tacdata.skin.linear.rest_stiffness import rest_solver

PLACES, MODULI = [(0.1, -0.2, 1.9), (-0.4, 0.3, 1.7), (0.0, 0.0, 2.5)], [0.30, 0.15, 0.90]
"""One touches little, one much, one not at all; moduli differ."""


@pytest.fixture(scope="module")
def body():
    return HeldSlab()


@pytest.fixture(scope="module")
def rest(body):
    return rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.rows, "cpu")


def normal_rows(body, pressed, member):
    """B of one member: mean normal displacement under the hats of active nodes, dense."""
    active = pressed.tangent.active[:, member].numpy()
    normal = pressed.tangent.normal[:, :, member].numpy()
    rows = body.rows.toarray().reshape(-1, 3, 3 * body.count)
    return np.einsum("ai,aik->ak", normal[active], rows[active])


def friction_stiffness(body, pressed, member):
    """T^T D T of one member, dense."""
    xx, yy, zz, xy, yz, xz = pressed.tangent.friction[:, :, member].numpy().T
    blocks = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    rows = body.rows.toarray().reshape(-1, 3, 3 * body.count)
    return np.einsum("jka,jkl,jlb->ab", rows, blocks, rows, optimize=True)


def by_dense_solve(body, pressed, member, r, c):
    """The saddle point system of one member on its free degrees of freedom, solved densely."""
    B, free = normal_rows(body, pressed, member)[:, body.free], body.free
    K = body.stiffness.toarray() * MODULI[member] / MATERIAL.youngs_modulus + friction_stiffness(body, pressed, member)
    system = np.block([[K[np.ix_(free, free)], B.T], [B, np.zeros((len(B), len(B)))]])
    solution = np.linalg.solve(system, np.concatenate([r[free], c]))
    z = np.zeros(3 * body.count)
    z[free] = solution[: len(free)]
    return z, solution[len(free) :]


@pytest.mark.parametrize("friction", [0.0, 0.2])
@pytest.mark.parametrize("solver", [FactoredCompliance, InvertedCompliance])
def test_it_solves_the_saddle_point_system_of_every_member(body, rest, friction, solver, monkeypatch):
    monkeypatch.setattr(constraint_preconditioner, "compliance_solver", lambda device: solver())
    pressed = PressedSlab(body, rest, friction, PLACES, MODULI)
    count = pressed.tangent.active.sum(dim=0).tolist()
    assert 0 < count[0] < count[1] and count[2] == 0
    r = body.random(5, 6, 7)
    gaps = torch.where(pressed.tangent.active, 0.01 * torch.linspace(-1, 1, pressed.surface.count)[:, None], 0.0)
    z, y = pressed.preconditioner.apply(r.reshape(body.count, 3, 3), [gaps])
    forces = pressed.preconditioner.forces(y)[0].numpy()
    for member in range(3):
        active = pressed.tangent.active[:, member].numpy()
        wanted = gaps[active, member].double().numpy()
        expected, multiplier = by_dense_solve(body, pressed, member, r[:, member].double().numpy(), wanted)
        found = z.reshape(-1, 3)[:, member].double().numpy()
        assert np.linalg.norm(found - expected) < 5e-3 * np.linalg.norm(expected)
        assert np.abs(forces[active, member] - multiplier).max(initial=0) < 1e-2 * np.abs(multiplier).max(initial=1)
        assert not forces[~active, member].any()
        held = normal_rows(body, pressed, member) @ found
        assert np.abs(held - wanted).max(initial=0) < 1e-4 * np.abs(found).max()


def test_some_members_alone_get_what_they_get_among_others(body, rest):
    pressed = PressedSlab(body, rest, 0.2, PLACES, MODULI)
    r = body.random(5, 6, 7).reshape(body.count, 3, 3)
    whole, y = pressed.preconditioner.apply(r)
    some = torch.tensor([2, 1])
    part, own = pressed.preconditioner.apply(r[:, :, some].contiguous(), None, some)
    assert (part - whole[:, :, some]).abs().max() < 1e-4 * whole.abs().max()
    assert (own - y[some]).abs().max() < 1e-3 * y.abs().max()


def test_it_is_symmetric_and_positive_as_conjugate_gradients_need(body, rest):
    preconditioner = PressedSlab(body, rest, 0.2, PLACES[1:2], MODULI[1:2]).preconditioner
    a, b = body.random(8), body.random(9)
    pa, pb = (preconditioner.apply(field.reshape(-1, 3, 1))[0].reshape(-1, 1) for field in (a, b))
    assert (b * pa).sum().item() == pytest.approx((a * pb).sum().item(), abs=1e-3 * (pa.norm() * b.norm()).item())
    assert (a * pa).sum() > 0 and (b * pb).sum() > 0


def test_without_contact_it_is_the_rest_stiffness_alone(body, rest):
    preconditioner = PressedSlab(body, rest, 0.2, PLACES[2:], [0.60]).preconditioner
    r = body.random(5)
    z, y = preconditioner.apply(r.reshape(-1, 3, 1))
    assert torch.equal(z.reshape(-1, 1), rest.apply(r) * 0.5) and not y.any()


def test_constraints_are_made_anew_where_they_are_others(body, rest, monkeypatch):
    """Not where they turned by less than a fiftieth; where a modulus or a node is another, for this member alone."""
    pressed = PressedSlab(body, rest, 0.2, PLACES, MODULI)
    asked = []
    update = pressed.preconditioner.solver.update
    monkeypatch.setattr(
        pressed.preconditioner.solver,
        "update",
        lambda sizes, changed, *rest: (asked.append(changed), update(sizes, changed, *rest)),
    )
    modulus, tangent = pressed.conditions.modulus.clone(), pressed.tangent
    pressed.preconditioner.update([tangent], modulus)
    tangent.normal[:, 0, 1] += 0.01
    pressed.preconditioner.update([tangent], modulus)
    tangent.normal[:, 0, 1] += 0.02
    pressed.preconditioner.update([tangent], modulus)
    modulus[0] *= 2
    pressed.preconditioner.update([tangent], modulus)
    tangent.active[tangent.active[:, 1].nonzero()[0], 1] = False
    pressed.preconditioner.update([tangent], modulus)
    assert asked == [[], [], [1], [0], [1]]


@pytest.mark.parametrize("blocks", [1, 3])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_inverse_by_blocks_is_the_inverse(blocks, dtype):
    """Of matrices whose lower triangle alone is known; beyond their size nothing is touched."""
    random, size = np.random.default_rng(0), 128 * blocks
    q, _ = np.linalg.qr(random.normal(size=(3, size, size)))
    matrices = torch.as_tensor(q * np.geomspace(1.0, 100.0, size) @ q.transpose(0, 2, 1)).to(dtype)
    whole = torch.full((5, size + 7, size + 7), 3.0, dtype=dtype)
    row = torch.tensor([4, 0, 2])
    inverse_of(matrices.clone(), row, whole)
    found = whole[row, :size, :size]
    unit = torch.eye(size, dtype=torch.float64)
    assert (found.double() @ matrices.double() - unit).abs().max() < (1e-11 if dtype == torch.float64 else 1e-3)
    assert (whole[[1, 3]] == 3.0).all() and (whole[:, size:] == 3.0).all()
