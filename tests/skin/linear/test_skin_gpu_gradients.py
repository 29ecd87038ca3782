"""Projected conjugate gradients, plain and as a GPU runs them, here on the CPU: kernels, half precision, shrinking."""

import numpy as np
import pytest
import torch
from contact_examples import PressedSlab
from skin_examples import MATERIAL, HeldSlab, batch

from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear import constraint_preconditioner, cuda_cg
from tacdata.skin.linear.constraint_solvers import InvertedCompliance
from tacdata.skin.linear.cuda_cg import CudaConjugateGradients
from tacdata.skin.linear.projected_cg import Stopping, projected_conjugate_gradients
from tacdata.skin.linear.rest_stiffness import DenseRest, SparseRest
from tacdata.skin.linear.tangent import TangentStiffness

MEMBERS = 40


class Problem:
    """Spheres pressed in differently deep, some not touching; right-hand sides of norm 1, gaps to be closed."""

    def __init__(self, held: HeldSlab, rest) -> None:
        """Linearize at squeezed states."""
        depth = np.linspace(-0.1, 0.25, MEMBERS)
        pressed = PressedSlab(held, rest, 0.2, [(d, -d, 2.0 - d) for d in depth], [MATERIAL.youngs_modulus] * MEMBERS)
        squeezed = np.zeros_like(held.mesh.nodes)
        squeezed[:, 2] = -0.02 * held.mesh.nodes[:, 2] * (1 - (held.mesh.nodes[:, 0] / 2) ** 2)
        u = batch(*[squeezed * k / MEMBERS for k in range(MEMBERS)])
        self.preconditioner, self.active = pressed.preconditioner, pressed.tangent.active
        self.tangent = TangentStiffness(Elasticity(held.mesh, "neo_hookean"), [pressed.surface])
        self.at = self.tangent.at(u.float(), pressed.conditions, [pressed.tangent])
        self.free = torch.as_tensor(~held.mesh.bottom).float()[:, None, None]
        r = held.random(*range(MEMBERS)).reshape(held.count, 3, MEMBERS)
        self.r = r / r.norm(dim=(0, 1))
        self.gaps = torch.where(self.active, 0.1, 0.0).double()

    def product(self, at, p):
        """K on free nodes."""
        result = torch.zeros_like(p)
        self.tangent.add_product(at, p, result)
        return result * self.free

    def plain(self, wanted=None, stopping=None):
        """As on the CPU."""
        wanted = torch.ones(MEMBERS, dtype=torch.bool) if wanted is None else wanted
        return projected_conjugate_gradients(
            self.product,
            self.at,
            self.preconditioner,
            torch.where(wanted, self.r, 0.0),
            [torch.where(wanted, self.gaps, 0.0)],
            wanted,
            stopping or Stopping(1e-3, 200),
        )

    def cuda(self, wanted=None, stopping=None):
        """As on a GPU."""
        wanted = torch.ones(MEMBERS, dtype=torch.bool) if wanted is None else wanted
        solver = CudaConjugateGradients(self.tangent, self.preconditioner)
        return solver.solve(
            self.at,
            torch.where(wanted, self.r, 0.0),
            [torch.where(wanted, self.gaps, 0.0)],
            wanted,
            stopping or Stopping(1e-3, 200),
        )


@pytest.fixture(scope="module")
def held():
    return HeldSlab()


@pytest.fixture
def on_a_gpu(held):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(constraint_preconditioner, "compliance_solver", lambda device: InvertedCompliance())
        return Problem(held, DenseRest(held.stiffness, held.free, held.rows, "cpu"))


@pytest.fixture(scope="module")
def on_the_cpu(held):
    return Problem(held, SparseRest(held.stiffness, held.free, held.rows))


def near(some, other, tolerance=1e-2):
    assert ((some - other).norm(dim=(0, 1)) < tolerance * other.norm(dim=(0, 1)).clamp_min(1e-6)).all()


def mean_changes(problem, x):
    """By how much x changes the mean gaps of active nodes."""
    surface, [contact] = problem.tangent.surfaces[0], problem.at.contacts
    return torch.where(problem.active, (surface.mortar.means(x.double()) * contact.normal).sum(dim=1), 0.0)


@pytest.mark.parametrize("way", ["plain", "cuda"])
def test_every_member_is_solved_and_keeps_its_constraints(on_a_gpu, on_the_cpu, way):
    problem = on_the_cpu if way == "plain" else on_a_gpu
    x, y, _ = getattr(problem, way)()
    near(x, on_the_cpu.plain()[0], 5e-3)
    assert (mean_changes(problem, x) - problem.gaps).abs().max() < (1e-3 if way == "plain" else 1e-2)
    surface, [contact] = problem.tangent.surfaces[0], problem.at.contacts
    [forces] = problem.preconditioner.forces(y)
    pushed = torch.zeros_like(x).double()
    surface.mortar.spread((contact.normal * forces[:, None]).contiguous(), pushed)
    left = (problem.r - problem.product(problem.at, x) - pushed.float()) * problem.free
    assert left.norm(dim=(0, 1)).max() < 0.02 * pushed.norm(dim=(0, 1)).clamp_min(1.0).max()


def test_a_member_that_is_done_costs_nothing_more(on_the_cpu):
    widths, product = [], on_the_cpu.product

    def watched(at, p):
        widths.append(p.shape[2])
        return product(at, p)

    on_the_cpu.product = watched
    try:
        together, _, _ = on_the_cpu.plain()
    finally:
        on_the_cpu.product = product
    assert widths[0] == MEMBERS and widths == sorted(widths, reverse=True) and widths[-1] < MEMBERS / 2
    alone, _, _ = on_the_cpu.plain(torch.arange(MEMBERS) == 30)
    near(alone[:, :, 30:31], together[:, :, 30:31], 1e-3)


def test_a_batch_that_shrinks_finds_what_one_that_does_not_finds(on_a_gpu, monkeypatch):
    shrunk, forces, _ = on_a_gpu.cuda()
    widths, iterate = [], CudaConjugateGradients._iterate

    def watched(me, now):
        widths.append(now.width)
        iterate(me, now)

    monkeypatch.setattr(CudaConjugateGradients, "_iterate", watched)
    again, _, _ = on_a_gpu.cuda()
    assert widths[0] == MEMBERS and widths[-1] < MEMBERS, "it did shrink"
    monkeypatch.setattr(cuda_cg, "_SHRINK", 0.0)
    whole, same, _ = on_a_gpu.cuda()
    assert torch.allclose(shrunk, again, atol=1e-4 * float(shrunk.abs().max()))
    near(shrunk, whole, 5e-3)
    assert (forces - same).abs().max() < 1e-2 * same.abs().max()


@pytest.mark.parametrize("way", ["plain", "cuda"])
def test_members_not_wanted_get_nothing_and_change_nothing(on_a_gpu, on_the_cpu, way):
    solve = on_the_cpu.plain if way == "plain" else on_a_gpu.cuda
    wanted = torch.arange(MEMBERS) % 3 == 0
    some, forces, _ = solve(wanted)
    assert not some[:, :, ~wanted].any() and not forces[~wanted].any()
    near(some[:, :, wanted], solve()[0][:, :, wanted], 5e-3)
    assert not solve(torch.zeros(MEMBERS, dtype=torch.bool))[0].any()


@pytest.mark.parametrize("way", ["plain", "cuda"])
def test_stragglers_are_cut_short(on_a_gpu, on_the_cpu, way):
    solve = on_the_cpu.plain if way == "plain" else on_a_gpu.cuda
    assert solve(stopping=Stopping(1e-3, 200, 1.0, 2))[2] == 2 < solve()[2]


def test_right_hand_sides_of_any_size_fit_half_precision(on_a_gpu, held):
    """Gaps to be closed may weigh ten thousand times what the forces do."""
    on_the_cpu = Problem(held, SparseRest(held.stiffness, held.free, held.rows))
    touching = on_a_gpu.active.any(dim=0)
    assert touching.sum() > MEMBERS / 3
    for problem in (on_a_gpu, on_the_cpu):
        problem.r = problem.r * 1e-4
    near(on_a_gpu.cuda()[0][:, :, touching], on_the_cpu.plain()[0][:, :, touching], 1e-2)


@pytest.mark.parametrize("way", ["plain", "cuda"])
def test_an_indefinite_tangent_gives_the_preconditioned_residual(on_a_gpu, on_the_cpu, way, monkeypatch):
    """That one keeps the constraints; no direction after it is followed upwards."""
    problem = on_the_cpu if way == "plain" else on_a_gpu

    def negative(body, u, p, conditions, product, dilatation=None):
        product.sub_(1e3 * p)

    monkeypatch.setattr(Elasticity, "tangent_product", negative)
    x, _, used = getattr(problem, way)()
    expected, _ = problem.preconditioner.apply(problem.r, [problem.gaps])
    assert used <= 2
    near(x, expected)


def test_it_asks_for_the_parts_of_a_gpu(on_the_cpu):
    with pytest.raises(TypeError, match="dense rest state"):
        CudaConjugateGradients(on_the_cpu.tangent, on_the_cpu.preconditioner)
