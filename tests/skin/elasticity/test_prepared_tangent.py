"""A tangent that is prepared once gives the products that the law gives."""

from dataclasses import replace

import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata.sensor.sensor import Material
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.elasticity.prepared_tangent import PreparedTangent
from tacdata.skin.member.conditions import Conditions, conditions

MEMBERS = 11
"""More than fit into one vector of lanes."""


@pytest.fixture(scope="module", params=["neo_hookean", "ogden"])
def law(request):
    return request.param


@pytest.fixture(scope="module")
def body(law):
    return Elasticity(box_mesh(slab_sensor(size=3.0), 3, 3, 2), law, averaged=True)


@pytest.fixture(scope="module")
def members(law) -> Conditions:
    """Skins of different stiffness and thickness."""
    own = Conditions.joined([conditions(Material(law, 0.5 + 0.1 * k, 0.47), 0.2) for k in range(MEMBERS)])
    return replace(own, thickness=torch.linspace(0.8, 1.3, MEMBERS, dtype=torch.float64)).to(torch.float32)


def field(body, seed, size=1.0):
    random = torch.Generator().manual_seed(seed)
    return size * torch.randn(len(body.mesh.nodes), 3, MEMBERS, generator=random)


def by_the_law(body, u, p, members):
    result = torch.zeros_like(p)
    body.tangent_product(u, p, members, result)
    return result


def of(prepared, p, which):
    result = torch.zeros_like(p)
    prepared.add_product(p, which, result)
    return result


def prepared(body) -> PreparedTangent:
    made = body.prepared()
    assert made is not None
    return made


def off(found, right):
    return float((found - right).abs().max() / right.abs().max())


def test_its_products_are_those_of_the_law(body, members):
    u, p, tangent, everyone = field(body, 1, 0.03), field(body, 2), prepared(body), torch.arange(MEMBERS)
    tangent.update(u, members, everyone)
    assert off(of(tangent, p, everyone), by_the_law(body, u, p, members)) < 1e-5


def test_members_are_left_out_in_any_order(body, members):
    u, p, tangent = field(body, 1, 0.03), field(body, 2), prepared(body)
    tangent.update(u, members, torch.arange(MEMBERS))
    some = torch.tensor([9, 2, 3])
    right = by_the_law(body, u, p, members)[:, :, some]
    assert off(of(tangent, p[:, :, some].contiguous(), some), right) < 1e-5
    kept = torch.tensor([1, 9, 10])
    tangent.keep(kept)
    right = by_the_law(body, u, p, members)[:, :, kept]
    assert off(of(tangent, p[:, :, kept].contiguous(), torch.arange(3)), right) < 1e-5


def test_what_moves_is_asked_anew_and_what_stays_is_not(body, members):
    u, p, tangent, everyone = field(body, 1, 0.03), field(body, 2), prepared(body), torch.arange(MEMBERS)
    tangent.update(u, members, everyone)
    before = of(tangent, p, everyone)
    barely, far = u + field(body, 3, 1e-5), u + field(body, 3, 0.03)
    tangent.update(barely, members, everyone)
    assert torch.equal(of(tangent, p, everyone), before)
    assert off(before, by_the_law(body, barely, p, members)) < 1e-3
    tangent.update(far, members, everyone)
    assert off(of(tangent, p, everyone), by_the_law(body, far, p, members)) < 0.02
    assert off(before, by_the_law(body, far, p, members)) > 0.02


def test_a_new_press_finds_nothing_of_the_one_before(body, members):
    u, p, tangent, everyone = field(body, 1, 0.03), field(body, 2), prepared(body), torch.arange(MEMBERS)
    tangent.update(u + field(body, 3, 1e-4), members, everyone)
    tangent.forget(torch.tensor([4]))
    tangent.update(u, members, everyone)
    fresh = prepared(body)
    fresh.update(u, members, everyone)
    found, right = of(tangent, p, everyone), of(fresh, p, everyone)
    assert torch.equal(found[:, :, 4], right[:, :, 4])
    assert not torch.equal(found[:, :, 5], right[:, :, 5])


@pytest.mark.parametrize("fields", [1, 8, MEMBERS])
def test_one_state_serves_many_fields_at_a_time(body, members, fields):
    """Of another state nothing is left, whatever has moved; fewer fields than were said may come."""
    tangent, p = prepared(body), field(body, 2)[:, :, :fields].contiguous()
    for seed in (1, 4):
        u, one = field(body, seed, 0.03)[:, :, :1].contiguous(), members.take(torch.tensor([3]))
        tangent.update_one(u, one, fields)
        right = by_the_law(body, u.repeat(1, 1, fields), p, one.repeat(fields))
        assert off(of(tangent, p, torch.arange(fields)), right) < 1e-5
        few = max(1, fields - 2)
        assert off(of(tangent, p[:, :, :few].contiguous(), torch.arange(few)), right[:, :, :few]) < 1e-5


def test_without_averages_nothing_is_prepared():
    assert Elasticity(box_mesh(slab_sensor(size=3.0), 2, 2, 1), "neo_hookean").prepared() is None
