"""Conjugate gradients as a GPU runs them, here on the CPU: fused kernels, half precision, a batch that shrinks."""

import numpy as np
import pytest
import torch
from skin_examples import MATERIAL, HeldSlab, batch, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear import contact_preconditioner, cuda_cg
from tacdata.skin.linear.cg import Stopping, conjugate_gradients
from tacdata.skin.linear.contact_transfer import DenseTransfer
from tacdata.skin.linear.cuda_cg import CudaConjugateGradients
from tacdata.skin.linear.rest_stiffness import DenseRest
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.solve.configuration import Configuration
from tacdata.skin.solve.newton import Newton
from tacdata.skin.solve.settings import SolverSettings

MEMBERS = 40
SPHERE = Sphere(2.0)


@pytest.fixture(scope="module")
def held():
    return HeldSlab()


@pytest.fixture
def problem(held, monkeypatch):
    """Spheres pressed in differently deep, some not touching; right-hand sides of norm 1."""
    monkeypatch.setattr(contact_preconditioner, "contact_transfer", lambda members, device: DenseTransfer(members))
    nodes, faces = torch.as_tensor(held.mesh.nodes), torch.as_tensor(held.mesh.outer)
    surface = ContactSurface(nodes, faces, 1, SPHERE.distance_function(), True, 1e3, 30.0)
    own = conditions(slab_sensor().material, 0.2, SPHERE).repeat(MEMBERS)
    depth = torch.linspace(-0.1, 0.25, MEMBERS, dtype=torch.float64)
    place = torch.stack([depth, -depth, 2.0 - depth])
    pose = Pose(place, torch.eye(3, dtype=torch.float64)[:, :, None].repeat(1, 1, MEMBERS))
    squeezed = np.zeros_like(held.mesh.nodes)
    squeezed[:, 2] = -0.04 * held.mesh.nodes[:, 2] * (1 - (held.mesh.nodes[:, 0] / 2) ** 2)
    u = batch(*[squeezed * k / MEMBERS for k in range(MEMBERS)])
    body = Elasticity(held.mesh, "neo_hookean")
    rest = DenseRest(held.stiffness, held.free, held.loadable, "cpu")
    preconditioner = contact_preconditioner.ContactPreconditioner(
        rest, [surface], torch.as_tensor(held.loadable), 3 * held.count, MATERIAL.youngs_modulus
    )
    newton = Newton(body, [surface], torch.as_tensor(held.mesh.bottom), preconditioner, SolverSettings())
    at = Configuration(u, own, (pose,), (surface.start(pose),), torch.zeros(MEMBERS, dtype=torch.float64))
    contacts = [contact.tangent for contact in newton.residual(at).contacts]
    preconditioner.update(contacts, own.modulus)
    r = held.random(*range(MEMBERS)).reshape(held.count, 3, MEMBERS)
    return newton, newton.tangent.at(u.float(), own, contacts), r / r.norm(dim=(0, 1))


def solve(problem, wanted=None, tolerance=1e-3, stragglers=0.0, long=8):
    newton, at, r = problem
    wanted = torch.ones(MEMBERS, dtype=torch.bool) if wanted is None else wanted
    solver = CudaConjugateGradients(newton.tangent, newton.preconditioner)
    return solver.solve(at, torch.where(wanted, r, 0.0), wanted, Stopping(tolerance, 200, stragglers, long))


def test_every_member_is_solved(problem):
    newton, at, r = problem
    x, _ = solve(problem)
    left = (newton.product(at, x) - r).norm(dim=(0, 1))
    assert left.max() < 5e-3
    apply = newton.preconditioner.apply
    plain, _ = conjugate_gradients(lambda p: newton.product(at, p), apply, r, Stopping(1e-3, 400, 0.3))
    assert ((x - plain).norm(dim=(0, 1)) < 5e-3 * plain.norm(dim=(0, 1))).all()


def test_a_batch_that_shrinks_finds_what_one_that_does_not_finds(problem, monkeypatch):
    shrunk, _ = solve(problem)
    widths, iterate = [], CudaConjugateGradients._iterate

    def watched(me, now):
        widths.append(now.width)
        iterate(me, now)

    monkeypatch.setattr(CudaConjugateGradients, "_iterate", watched)
    again, _ = solve(problem)
    assert widths[0] == MEMBERS and widths[-1] < MEMBERS, "it did shrink"
    monkeypatch.setattr(cuda_cg, "_SHRINK", 0.0)
    whole, _ = solve(problem)
    assert torch.allclose(shrunk, again, atol=1e-6)
    assert ((shrunk - whole).norm(dim=(0, 1)) < 5e-3 * whole.norm(dim=(0, 1))).all()


def test_members_not_wanted_get_nothing_and_change_nothing(problem):
    wanted = torch.arange(MEMBERS) % 3 == 0
    some, _ = solve(problem, wanted)
    assert some[:, :, ~wanted].abs().max() == 0
    every, _ = solve(problem)
    assert ((some - every)[:, :, wanted].norm(dim=(0, 1)) < 5e-3 * every[:, :, wanted].norm(dim=(0, 1))).all()
    assert solve(problem, torch.zeros(MEMBERS, dtype=torch.bool))[0].abs().max() == 0


def test_stragglers_are_cut_short(problem):
    _, whole = solve(problem)
    _, short = solve(problem, stragglers=1.0, long=2)
    assert short == 2 < whole


def test_an_indefinite_tangent_gives_the_preconditioned_residual(problem, monkeypatch):
    newton, _, r = problem

    def negative(body, u, p, conditions, product, dilatation=None):
        product.sub_(1e3 * p)

    monkeypatch.setattr(Elasticity, "tangent_product", negative)
    x, used = solve(problem)
    expected = newton.preconditioner.apply(r)
    assert used == 2
    assert ((x - expected).norm(dim=(0, 1)) < 1e-2 * expected.norm(dim=(0, 1))).all()
