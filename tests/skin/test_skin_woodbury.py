"""The contact's share of the preconditioner by the Woodbury identity, and the batched inverse under it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
from skin_examples import MATERIAL, HeldSlab, batch, joined

from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear import contact_preconditioner
from tacdata.skin.linear.batched_inverse import inverse, inverse_of_sum
from tacdata.skin.linear.contact_preconditioner import ContactPreconditioner
from tacdata.skin.linear.contact_transfer import DenseTransfer, FactoredTransfer
from tacdata.skin.linear.coupled_dofs import coupling
from tacdata.skin.linear.rest_stiffness import rest_solver
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose

PENALTY, STICK = 3000.0, 100.0
"""Over Young's modulus [1/mm]: stiff, so that the contact's share matters."""
SPHERE = Sphere(2.0)


@pytest.fixture(scope="module")
def body():
    return HeldSlab()


@pytest.fixture(scope="module")
def rest(body):
    return rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.loadable, "cpu")


def pressed(body, rest, friction, places, moduli):
    """A contact with one sphere a member, with its stiffness at rest, and its preconditioner."""
    nodes, faces = torch.as_tensor(body.mesh.nodes), torch.as_tensor(body.mesh.outer)
    surface = ContactSurface(nodes, faces, 1, SPHERE.distance_function(), friction > 0, PENALTY, STICK)
    members = joined(*(conditions(replace(MATERIAL, youngs_modulus=e), friction, SPHERE) for e in moduli))
    turn = torch.eye(3, dtype=torch.float64)[:, :, None].repeat(1, 1, len(places))
    pose = Pose(torch.tensor(places, dtype=torch.float64).T.contiguous(), turn)
    u = batch(*[np.zeros_like(body.mesh.nodes)] * len(places))
    secant = torch.zeros_like(members.modulus)
    at = surface.add_forces(u, pose, surface.start(pose), members, secant, torch.zeros_like(u)).tangent
    made = ContactPreconditioner(
        rest, [surface], torch.as_tensor(body.loadable), 3 * body.count, MATERIAL.youngs_modulus
    )
    made.update([at], members.modulus)
    return (surface, at), made


def tangent_times(body, contact, x, moduli):
    """Rest stiffness of each member plus its contact's, times fields (3n, b)."""
    field = x.double().reshape(body.count, 3, -1)
    r = body.times(x) * torch.tensor(moduli, dtype=torch.float64) / MATERIAL.youngs_modulus
    product = torch.zeros_like(field)
    surface, at = contact
    surface.add_product(at, field.contiguous(), product)
    r += product.reshape(r.shape)
    r[body.held] = 0
    return r.float()


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_with_contact_the_preconditioner_inverts_rest_plus_contact_stiffness(body, rest, friction):
    contact, preconditioner = pressed(body, rest, friction, [(0.1, -0.2, 1.9)], [0.30])
    x = body.random(5)
    assert (rest.apply(body.times(x).float()) - x).norm() < 1e-2 * x.norm()
    r = tangent_times(body, contact, x, [0.30])
    assert (preconditioner.apply(r.reshape(-1, 3, 1)).reshape(x.shape) - x).norm() < 2e-2 * x.norm()
    assert (rest.apply(r) - x).norm() > 10 * x.norm()


def test_members_with_other_contacts_and_moduli_are_inverted_side_by_side(body, rest):
    """One touches little, one much, one not at all; moduli differ."""
    places, moduli = [(0.1, -0.2, 1.98), (-0.4, 0.3, 1.9), (0.0, 0.0, 2.5)], [0.30, 0.15, 0.90]
    contact, preconditioner = pressed(body, rest, 0.2, places, moduli)
    touched = contact[1].touched.sum(dim=0)
    assert 0 < touched[0] < touched[1] and touched[2] == 0
    x = body.random(5, 6, 7)
    r = tangent_times(body, contact, x, moduli)
    back = preconditioner.apply(r.reshape(body.count, 3, 3)).reshape(x.shape)
    assert ((back - x).norm(dim=0) < 2e-2 * x.norm(dim=0)).all()


def test_it_is_symmetric_and_positive_as_conjugate_gradients_need(body, rest):
    _, preconditioner = pressed(body, rest, 0.2, [(0.1, -0.2, 1.9)], [0.30])
    a, b = body.random(8), body.random(9)
    pa, pb = (preconditioner.apply(field.reshape(-1, 3, 1)).reshape(-1, 1) for field in (a, b))
    assert (b * pa).sum().item() == pytest.approx((a * pb).sum().item(), abs=1e-3 * (pa.norm() * b.norm()).item())
    assert (a * pa).sum() > 0 and (b * pb).sum() > 0


def test_degrees_of_freedom_that_hardly_feel_the_contact_are_left_out(body, rest, monkeypatch):
    """A share knows fewer of them then; conjugate gradients by it still take half as many iterations as without any."""
    contact, everything = pressed(body, rest, 0.2, [(0.1, -0.2, 1.9)], [0.30])
    monkeypatch.setitem(contact_preconditioner._WEAK, "cpu", 0.1)
    _, fewer = pressed(body, rest, 0.2, [(0.1, -0.2, 1.9)], [0.30])
    known = [int((made._which < len(body.loadable)).sum()) for made in (everything, fewer)]
    assert 0.4 * known[0] < known[1] < 0.9 * known[0]
    r = tangent_times(body, contact, body.random(1), [0.30])
    whole, less, none = (
        iterations(lambda x: tangent_times(body, contact, x, [0.30]), apply, r)
        for apply in (
            lambda x: everything.apply(x.reshape(-1, 3, 1)).reshape(x.shape),
            lambda x: fewer.apply(x.reshape(-1, 3, 1)).reshape(x.shape), rest.apply,
        )
    )
    assert whole <= less < 0.5 * none


def iterations(product, precondition, r):
    """Of conjugate gradients to a thousandth of the preconditioned norm."""
    z = precondition(r)
    p, rho, count = z, (r * z).sum(), 0
    goal = 1e-6 * rho
    while rho > goal and count < 500:
        q = product(p)
        r = r - rho / (p * q).sum() * q
        z = precondition(r)
        before, rho = rho, (r * z).sum()
        p, count = z + rho / before * p, count + 1
    return count


def test_diagonals_are_those_of_the_faces_stiffness(body, rest):
    (surface, at), _ = pressed(body, rest, 0.2, [(0.1, -0.2, 1.98), (-0.4, 0.3, 1.9)], [0.30, 0.15])
    face, member = at.touched.nonzero().unbind(dim=1)
    whole = surface.face_stiffness(at, face, member).diagonal(dim1=1, dim2=2)
    assert whole.max() > 0
    assert (surface.face_diagonal(at, face, member) - whole).abs().max() < 1e-6 * whole.max()


def test_without_contact_it_is_the_rest_stiffness_alone(body, rest):
    _, preconditioner = pressed(body, rest, 0.2, [(0.0, 0.0, 2.5)], [0.60])
    r = body.random(5)
    assert torch.equal(preconditioner.apply(r.reshape(-1, 3, 1)).reshape(-1, 1), rest.apply(r) * 0.5)


def spd(rows, members, condition, seed=0):
    """Symmetric positive definite matrices of a given condition number, shape (b, m, m), float64."""
    random = np.random.default_rng(seed)
    made = []
    for _ in range(members):
        q, _ = np.linalg.qr(random.normal(size=(rows, rows)))
        made.append(q * np.geomspace(1.0, condition, rows) @ q.T)
    return torch.as_tensor(np.stack(made))


@pytest.mark.parametrize("rows", [1, 127, 128, 129, 200, 400])
def test_the_inverse_by_blocks_is_the_inverse(rows):
    """At any size beside the blocks' 128."""
    matrices = spd(rows, 3, 100.0)
    found = inverse(matrices)
    assert found.shape == matrices.shape
    assert (found @ matrices - torch.eye(rows)).abs().max() < 1e-11
    single = inverse(matrices.float())
    assert single.dtype == torch.float32
    assert (single.double() - found).abs().max() < 1e-4 * found.abs().max()


@pytest.mark.parametrize("make", [FactoredTransfer, DenseTransfer])
def test_a_member_put_anew_leaves_its_neighbours_as_they_are(make):
    compliance, stiffness = spd(70, 3, 50.0, seed=1), spd(70, 3, 30.0, seed=2)
    transfer, alone = make(3), make(3)
    moved = torch.as_tensor(np.random.default_rng(3).normal(size=(3, 80)))
    transfer.put(torch.tensor([0, 1]), stiffness[:2], compliance[:2])
    before = transfer.times(moved)
    assert before[2].abs().max() == 0 and before[:, 70:].abs().max() == 0
    transfer.put(torch.tensor([1]), stiffness[2:, :40, :40], compliance[2:, :40, :40])
    alone.put(torch.tensor([1]), stiffness[2:, :40, :40], compliance[2:, :40, :40])
    after = transfer.times(moved)
    assert torch.equal(after[0], before[0])
    assert torch.allclose(after[1], alone.times(moved)[1], rtol=1e-12) and after[1, 40:].abs().max() == 0
    transfer.put(torch.tensor([0]), stiffness[:1, :0, :0], compliance[:1, :0, :0])
    assert transfer.times(moved)[0].abs().max() == 0


@pytest.mark.parametrize("rows", [40, 130])
def test_both_formulas_for_the_contact_transfer_agree(rows):
    """(I + S G)^-1 S, as the CPU has it, is (S^-1 + G)^-1, as a GPU has it, with a faint stiffness added to S."""
    compliance, stiffness = spd(rows, 2, 50.0, seed=1), spd(rows, 2, 30.0, seed=2)
    stiffness[:, : rows // 2] = 0.0  # Most points of a face do not touch.
    stiffness[:, :, : rows // 2] = 0.0
    moved = torch.as_tensor(np.random.default_rng(3).normal(size=(2, rows)))
    both, unit = torch.arange(2), torch.eye(rows, dtype=torch.float64)
    faint = DenseTransfer._FAINT * unit / compliance.diagonal(dim1=1, dim2=2)[:, None]
    for make, known in ((FactoredTransfer, stiffness), (DenseTransfer, stiffness + faint)):
        expected = torch.linalg.inv(unit + known @ compliance) @ known
        expected = (expected @ moved[:, :, None])[:, :, 0]
        transfer = make(2)
        transfer.put(both, stiffness, compliance)
        found = transfer.times(moved)
        assert (found - expected).abs().max() < 1e-8 * expected.abs().max()
        transfer = make(2)
        transfer.put(both, stiffness.float(), compliance.float())
        single = transfer.times(moved.float())
        assert single.dtype == torch.float32
        assert (single - expected).abs().max() < 1e-4 * expected.abs().max()


@pytest.mark.parametrize("lead", [0, 100, 300])
def test_what_is_not_coupled_need_not_be_looked_at(lead):
    """Some rows coupled in any way, then blocks of 40; two members whose blocks stand elsewhere."""
    random, rows = np.random.default_rng(5), 620
    first = torch.zeros(2, rows, rows, dtype=torch.float64)
    for member, own in enumerate((lead, max(lead - 70, 0))):
        edges = [0, *range(own, rows, 40), rows]
        for low, high in pairwise(edges):
            root = torch.as_tensor(random.normal(size=(high - low, high - low)))
            first[member, low:high, low:high] = root @ root.T + torch.eye(high - low)
    second = spd(rows, 2, 30.0, seed=6)
    found, row = torch.zeros(3, rows, rows, dtype=torch.float64), torch.tensor([2, 0])
    inverse_of_sum(first, second, row, found, lead, 40)
    expected = torch.linalg.inv(torch.linalg.inv(first) + second)
    assert (found[row] - expected).abs().max() < 1e-9 * expected.abs().max()
    assert found[1].abs().max() == 0


def test_coupled_degrees_of_freedom_are_found():
    """The first contact's come first; the second's faces make parts of which the widest spans 5."""
    first, second = np.array([[0, 1, 2], [2, 3, 9]]), np.array([[4, 5, 20], [5, 8, 4], [10, 11, 12], [20, 20, 20]])
    assert coupling([first, second], 20) == (10, 0) or coupling([first, second], 20)[0] == 20
    first[1, 2] = 3
    assert coupling([first, second], 20) == (4, 5)
    assert coupling([first], 20) == (4, 0)
