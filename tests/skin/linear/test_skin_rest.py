"""The rest stiffness, its factor and dense inverse, and the compliance of the mortar rows."""

import numpy as np
import pytest
import torch
from skin_examples import MATERIAL, HeldSlab

from tacdata import registry
from tacdata.sensor.sensor import Material
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.rest_stiffness import DenseRest, rest_solver
from tacdata.skin.member.conditions import conditions


@pytest.fixture(scope="module")
def body():
    return HeldSlab()


@pytest.fixture(scope="module")
def rest(body):
    return rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.rows, "cpu")


def single(field):
    """In single precision, scaled to 1, as the solver hands it over; and the scale."""
    size = field.abs().max()
    return (field / size).float(), size


@pytest.mark.parametrize("law", registry.names("tacdata.skin.materials", "law"))
def test_the_rest_stiffness_is_every_laws_tangent_at_rest(body, law):
    p = body.random(1).double()
    field, product = p.reshape(-1, 3, 1), torch.zeros(body.count, 3, 1, dtype=torch.float64)
    member = conditions(Material(law, 0.30, 0.47), 0.0)
    Elasticity(body.mesh, law).tangent_product(torch.zeros_like(field), field, member, product)
    assembled = body.stiffness @ p.numpy()
    assert np.abs(product.numpy().reshape(-1, 1) - assembled).max() < 1e-12 * np.abs(assembled).max()


def test_the_factor_solves_to_single_precision_and_keeps_held_nodes(body, rest):
    r = body.random(2)
    x = rest.apply(r)
    assert x.dtype == torch.float32
    back = body.times(x)[body.free]
    assert (back - r[body.free]).norm() < 1e-3 * r.norm()
    assert not x[body.held].any()


def test_several_right_hand_sides_give_the_same_as_one_by_one(body, rest):
    together = rest.apply(body.random(3, 4))
    for column, seed in enumerate((3, 4)):
        alone = rest.apply(body.random(seed))[:, 0]
        assert (alone - together[:, column]).norm() < 1e-4 * alone.norm()


def test_what_is_held_needs_no_zero_in_the_right_hand_side(body, rest):
    r = body.random(2)
    loaded = r.clone()
    loaded[body.held] = 7.0
    assert torch.equal(rest.apply(loaded), rest.apply(r))


def test_rows_and_what_they_spread_do_the_same_work(body, rest):
    z, f = body.random(3, 4), torch.as_tensor(np.random.default_rng(5).normal(size=(body.rows.shape[0], 2))).float()
    assert torch.allclose(rest.rows(z), torch.as_tensor(body.rows @ z.double().numpy()).float(), atol=1e-5)
    assert (rest.rows(z) * f).sum().item() == pytest.approx((z * rest.spread(f)).sum().item(), rel=1e-3)


def everything(rest, body):
    return rest.table(torch.ones(body.rows.shape[0], dtype=torch.bool))


def check_compliance(rest, body, tolerance):
    """What a unit force on a row moves, symmetric and positive."""
    unit = torch.zeros(body.rows.shape[0], 1)
    unit[5] = 1.0
    moved = rest.rows(rest.apply(rest.spread(unit)))[:, 0]
    matrix = everything(rest, body)
    assert (matrix[5] - moved).norm() < tolerance * moved.norm()
    assert torch.equal(matrix, matrix.T)
    assert torch.linalg.eigvalsh(matrix.double()).min() > -1e-4


def test_compliance_is_what_a_unit_force_moves(body, rest):
    check_compliance(rest, body, 1e-5)


def test_compliance_asked_for_in_parts_is_that_of_the_whole(body):
    """Rows are made when first wanted: in any order they are the same to rounding, and the table is symmetric."""
    m = body.rows.shape[0]
    first, second = (rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.rows, "cpu") for _ in range(2))
    half = torch.arange(m) < m // 2
    early = first.table(half)[: m // 2, : m // 2].clone()
    whole = everything(first, body)
    assert torch.equal(early, whole[: m // 2, : m // 2]) and torch.equal(whole, whole.T)
    assert (everything(second, body) - whole).abs().max() < 1e-5 * whole.abs().max()


def test_forces_by_halves_of_a_solve_are_those_by_whole_ones(body):
    first, second = (rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.rows, "cpu") for _ in range(2))
    m, r = body.rows.shape[0], body.random(0, 1, 2)
    used = (torch.arange(m)[:, None] + torch.arange(3)) % 4 < 2
    for rest, part in ((first, torch.arange(m) % 5 < 2), (first, used.any(dim=1)), (second, used.any(dim=1))):
        rest.table(part)

    def forces(moved):
        return torch.where(used, 0.4 * moved, 0.0)

    second._halves = None
    halves, whole = first.held(r, used, forces), second.held(r, used, forces)
    assert (halves - whole).norm() < 1e-4 * whole.norm()
    assert (whole - second.apply(r)).norm() > 1e-2 * whole.norm()


@pytest.fixture(scope="module")
def dense(body):
    return DenseRest(body.stiffness, body.free, body.rows, "cpu")


def test_a_gpus_inverse_solves_as_the_factor(body, rest, dense):
    r = body.random(2)
    assert (dense.apply(r) - rest.apply(r)).norm() < 2e-2 * rest.apply(r).norm()


def test_a_gpus_compliance_is_that_of_its_rounded_inverse(body, rest, dense):
    """Half precision of the forces alone stands between them."""
    check_compliance(dense, body, 1e-3)
    exact, rounded = everything(rest, body), everything(dense, body)
    assert 1e-5 < (exact - rounded).norm() / exact.norm() < 1e-3


def test_a_gpus_own_rows_move_as_the_whole_does(body, dense):
    """M K0^-1, kept in half precision, beside M times the whole inverse."""
    r = body.random(2, 3)
    scaled = torch.zeros(dense.padded, 2)
    scaled[: len(body.free)] = r[body.free] * dense.scale[:, None]
    own = dense.rows_times(scaled.half()) * dense.row_scale[:, None]
    whole = dense.rows(dense.apply(r))
    assert ((own - whole).norm(dim=0) < 2e-3 * whole.norm(dim=0)).all()


def test_what_a_kernel_spreads_is_the_transpose_of_the_rows(body, dense):
    up, f = dense.spreads, np.random.default_rng(1).normal(size=body.rows.shape[0])
    found = np.zeros(len(body.free))
    for k, row in enumerate(up.row.tolist()):
        entries = slice(int(up.start[k]), int(up.start[k + 1]))
        found[row] = up.value[entries].double().numpy() @ f[up.column[entries].numpy()]
    np.testing.assert_allclose(found, (body.rows.T @ f)[body.free], atol=1e-6)


def test_a_gpus_inverse_has_aligned_rows(body):
    """Whatever the number of degrees of freedom: here one that is no multiple of eight, as most meshes'."""
    free = body.free[: len(body.free) - len(body.free) % 8 - 3]
    assert len(free) % 8
    dense = DenseRest(body.stiffness, free, body.rows, "cpu")
    assert dense.padded % 64 == 0 and dense.padded - len(free) < 64
    assert dense._inverse.stride(0) == dense._rows.stride(0) == dense.padded
    scaled = torch.zeros(dense.padded, 2, dtype=torch.float16)
    scaled[: len(free)] = 1.0
    again = scaled.clone()
    again[len(free) :] = 5.0
    assert torch.equal(dense.times(scaled), dense.times(again)), "what is beyond its rows says nothing"
