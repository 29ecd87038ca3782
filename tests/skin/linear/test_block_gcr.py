"""Linear solves that share one space of directions."""

import pytest
import torch

from tacdata.skin.linear.block_gcr import KrylovSpace

N = 40


def matrix(seed=0):
    """Unsymmetric, with a few stiff directions as contact has them, and an approximate inverse of it."""
    draws = torch.Generator().manual_seed(seed)
    soft = torch.eye(3 * N, dtype=torch.float64) * 2 + 0.3 * torch.randn(3 * N, 3 * N, generator=draws).double() / 11
    stiff = torch.randn(3 * N, 5, generator=draws).double()
    a = soft + 1e3 * stiff @ stiff.T
    rough = torch.linalg.inv(a + 0.2 * torch.randn(3 * N, 3 * N, generator=draws).double() / 11)
    return a, rough.float()


def fields(seed, count):
    return torch.randn(N, 3, count, generator=torch.Generator().manual_seed(seed)).double()


class Counted:
    """The matrix and its approximate inverse as fields see them, and how many columns they were asked for."""

    def __init__(self, a, rough):
        self.a, self.rough, self.columns = a, rough, 0

    def product(self, p):
        self.columns += p.shape[2]
        return (self.a.to(p.dtype) @ p.reshape(3 * N, -1)).reshape(p.shape)

    def precondition(self, r):
        return (self.rough @ r.reshape(3 * N, -1)).reshape(r.shape)


def exact(a, rhs):
    return torch.linalg.solve(a, rhs.reshape(3 * N, -1)).reshape(rhs.shape)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-9])
def test_every_column_is_as_exact_as_asked(tolerance):
    """1e-9 is beyond single precision: residuals are taken anew in double."""
    a, rough = matrix()
    seen, rhs = Counted(a, rough), fields(1, 4)
    found = KrylovSpace(seen.product, seen.precondition).solve(rhs, torch.zeros_like(rhs), tolerance)
    wanted = exact(a, rhs)
    off = torch.linalg.vector_norm(found.x - wanted, dim=(0, 1)) / torch.linalg.vector_norm(wanted, dim=(0, 1))
    assert (off < 2 * tolerance).all() and (found.error <= tolerance).all()


def test_later_right_hand_sides_profit_from_the_space():
    a, rough = matrix()
    first = fields(1, 3)
    second = first @ torch.tensor([[1.0, 0.5, 0.0], [0.0, 1.0, -0.5], [0.2, 0.0, 1.0]]).double() + 1e-4 * fields(2, 3)
    shared, alone = Counted(a, rough), Counted(a, rough)
    space = KrylovSpace(shared.product, shared.precondition)
    space.solve(first, torch.zeros_like(first), 1e-4)
    before = shared.columns
    with_space = space.solve(second, torch.zeros_like(second), 1e-4)
    without = KrylovSpace(alone.product, alone.precondition).solve(second, torch.zeros_like(second), 1e-4)
    assert shared.columns - before < 0.6 * alone.columns
    assert torch.allclose(with_space.x, without.x, atol=1e-3)


def test_columns_that_are_there_ask_for_nothing_more():
    """Three of four start at their solution: about a quarter of the columns is asked for."""
    a, rough = matrix()
    rhs = fields(3, 4)
    guess = exact(a, rhs)
    guess[:, :, 2] = 0.0
    seen, whole = Counted(a, rough), Counted(a, rough)
    found = KrylovSpace(seen.product, seen.precondition).solve(rhs, guess, 1e-4)
    KrylovSpace(whole.product, whole.precondition).solve(rhs, torch.zeros_like(rhs), 1e-4)
    assert seen.columns < 0.6 * whole.columns and (found.error <= 1e-4).all()


def test_small_columns_of_a_sum_ask_for_little():
    """Weighted, the second solution is a hundredth of the first: it needs two digits less."""
    a, rough = matrix()
    rhs, weight = fields(7, 2), torch.tensor([1.0, 0.01], dtype=torch.float64)
    summed, apart = Counted(a, rough), Counted(a, rough)
    zero = torch.zeros_like(rhs)
    found = KrylovSpace(summed.product, summed.precondition).solve(rhs, zero, 1e-5, weight=weight)
    KrylovSpace(apart.product, apart.precondition).solve(rhs, zero, 1e-5)
    off = torch.linalg.vector_norm(found.x - exact(a, rhs), dim=(0, 1)) * weight
    assert (off < 2e-5 * torch.linalg.vector_norm(exact(a, rhs), dim=(0, 1))[0]).all() and (found.error <= 1e-5).all()
    assert summed.columns < 0.85 * apart.columns


def test_equal_columns_and_those_without_a_right_hand_side():
    a, rough = matrix()
    seen, rhs = Counted(a, rough), fields(4, 1).repeat(1, 1, 3)
    rhs[:, :, 1] = 0.0
    found = KrylovSpace(seen.product, seen.precondition).solve(rhs, torch.ones_like(rhs), 1e-6)
    assert not found.x[:, :, 1].any() and found.error[1] == 0
    assert torch.allclose(found.x[:, :, 0], found.x[:, :, 2], rtol=1e-5)
    assert torch.allclose(found.x, exact(a, rhs), atol=1e-5)


def test_a_small_space_begins_anew():
    a, rough = matrix()
    seen, rhs = Counted(a, rough), fields(5, 4)
    found = KrylovSpace(seen.product, seen.precondition, limit=8).solve(rhs, torch.zeros_like(rhs), 1e-6)
    assert (found.error <= 1e-6).all()


def test_what_does_not_converge_says_how_far_it_is():
    a, _ = matrix()
    seen, rhs = Counted(a, torch.eye(3 * N)), fields(6, 2)
    found = KrylovSpace(seen.product, seen.precondition).solve(rhs, torch.zeros_like(rhs), 1e-8, limit=4)
    assert found.products >= 4 and (found.error > 1e-8).any()
