"""The rest stiffness, its factor, and the compliance between degrees of freedom that contact may load."""

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
    return rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.loadable, "cpu")


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


def test_the_loadable_part_is_that_of_the_whole(body, rest):
    r = body.random(3, 4)
    assert torch.equal(rest.loadable(r), rest.apply(r)[body.loadable])


def test_compliance_is_what_a_unit_force_moves(body, rest):
    m = len(body.loadable)
    matrix = rest.compliance(torch.arange(m)[None])[0]
    unit = torch.zeros(3 * body.count, 1)
    unit[body.loadable[5]] = 1.0
    moved = rest.apply(unit)[body.loadable, 0]
    assert (matrix[5] - moved).norm() < 1e-5 * moved.norm()
    assert torch.equal(matrix, matrix.T)
    assert torch.linalg.eigvalsh(matrix.double()).min() > -1e-4


def test_compliance_asked_for_in_parts_is_that_of_the_whole(body):
    """Rows are made when first wanted: whatever the order, they are the same."""
    m = len(body.loadable)
    first, second = (rest_solver(body.mesh, MATERIAL, body.mesh.bottom, body.loadable, "cpu") for _ in range(2))
    early = first.compliance(torch.arange(m)[None, : m // 2]).clone()
    whole = first.compliance(torch.arange(m)[None])
    assert torch.equal(early[0], whole[0, : m // 2, : m // 2])
    assert (second.compliance(torch.arange(m)[None]) - whole).abs().max() < 1e-5 * whole.abs().max()


def test_members_ask_for_their_own_and_for_none(body, rest):
    m = len(body.loadable)
    whole = rest.compliance(torch.arange(m)[None])[0]
    which = torch.tensor([[4, 9, 30], [7, m, m]])
    blocks = rest.compliance(which)
    assert torch.equal(blocks[0], whole[which[0]][:, which[0]])
    assert blocks[1, 0, 0] == whole[7, 7]
    blocks[1, 0, 0] = 0
    assert not blocks[1].any()


def test_a_cards_inverse_solves_as_the_factor(body, rest):
    dense = DenseRest(body.stiffness, body.free, body.loadable, "cpu")
    r = body.random(2)
    assert (dense.apply(r) - rest.apply(r)).norm() < 2e-2 * rest.apply(r).norm()


def test_a_cards_inverse_has_aligned_rows(body):
    """Whatever the number of degrees of freedom: here one that is no multiple of eight, as most meshes'."""
    inner = np.setdiff1d(body.free, body.loadable)
    free = np.setdiff1d(body.free, inner[: len(body.free) % 8 + 3])
    assert len(free) % 8
    dense = DenseRest(body.stiffness, free, body.loadable, "cpu")
    assert dense.padded % 64 == 0 and dense.padded - len(free) < 64
    assert dense._inverse.stride(0) == dense.padded
    scaled = torch.zeros(dense.padded, 2, dtype=torch.float16)
    scaled[: len(free)] = 1.0
    again = scaled.clone()
    again[len(free) :] = 5.0
    assert torch.equal(dense.times(scaled), dense.times(again)), "what is beyond its rows says nothing"
