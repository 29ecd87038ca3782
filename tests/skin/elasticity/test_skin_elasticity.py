"""Internal forces, energy and tangent of the body, free of contact."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from skin_examples import batch, box_mesh, joined, random_rotation, slab_sensor

from tacdata import registry
from tacdata.sensor.sensor import Material
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.member.conditions import Conditions, conditions
from tacdata.skin.mesh.skin_mesh import SkinMesh

LAWS = registry.names("tacdata.skin.materials", "law")


@pytest.fixture(scope="module")
def mesh() -> SkinMesh:
    """A box of 3 x 3 x 2 cells whose inner corners are shaken, so that no two elements are alike."""
    sensor = slab_sensor(size=3.0)
    box = box_mesh(sensor, 3, 3, 2)
    random = np.random.default_rng(3)
    nodes, corners = box.nodes.copy(), np.unique(box.tets[:, :4])
    shaken = corners[~surface(box)[corners]]
    nodes[shaken] += random.uniform(-0.15, 0.15, (len(shaken), 3))
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    for k, (a, b) in enumerate(pairs):
        nodes[box.tets[:, 4 + k]] = (nodes[box.tets[:, a]] + nodes[box.tets[:, b]]) / 2
    return SkinMesh(nodes, box.tets, box.outer, box.protrusions, box.protrusion_taxel, box.sides, box.bottom)


def surface(mesh):
    return mesh.sides | (np.abs(mesh.nodes[:, 2]) < 1e-9) | (np.abs(mesh.nodes[:, 2] - 2) < 1e-9)


@dataclass(frozen=True)
class Body:
    """An elastic body and what its members are made of."""

    elastic: Elasticity
    member: Conditions

    def force(self, u):
        """Nodal forces and smallest det F."""
        return self.elastic.internal_force(u, self.members(u))

    def energy(self, u):
        return self.elastic.energy(u, self.members(u))

    def product(self, u, p):
        """The tangent at u times p."""
        result = torch.zeros_like(p)
        self.elastic.tangent_product(u, p, self.members(u), result)
        return result

    def members(self, u):
        return self.member if self.member.law.shape[1] == u.shape[2] else self.member.repeat(u.shape[2])


def made_of(mesh, law, youngs_modulus=0.30, poisson_ratio=0.47, **other):
    return Body(Elasticity(mesh, law), conditions(Material(law, youngs_modulus, poisson_ratio), 0.0, **other))


@pytest.fixture(scope="module", params=LAWS)
def body(request, mesh):
    return made_of(mesh, request.param)


def wobble(mesh, seed, size=0.1):
    """A smooth displacement with strains of about ``size``."""
    random = np.random.default_rng(seed)
    u = mesh.nodes @ random.uniform(-size, size, (3, 3))
    return u + size * np.sin(mesh.nodes @ random.uniform(-1, 1, (3, 3)))


def test_an_affine_displacement_leaves_inner_nodes_without_force(body, mesh):
    stretch = np.array([[0.1, 0.05, 0.0], [-0.08, -0.1, 0.02], [0.03, 0.0, 0.15]])
    force, ratio = body.force(batch(mesh.nodes @ stretch.T))
    inner = ~surface(mesh)
    scale = force.abs().max().item()
    assert scale > 1e-3 and inner.sum() > 30
    assert force[inner].abs().max().item() < 1e-13 * max(1, 1 / scale)
    assert ratio.item() == pytest.approx(np.linalg.det(np.eye(3) + stretch), rel=1e-12)


def test_an_affine_displacement_has_the_energy_of_one_point(body, mesh):
    """Total energy = W(F) times the volume: the quadrature loses nothing."""
    stretch = np.diag([0.1, -0.05, 0.2])
    whole = body.energy(batch(mesh.nodes @ stretch)).item()
    one = SkinMesh(
        np.concatenate([np.eye(4)[:, 1:], np.zeros((6, 3))]),
        np.arange(10)[None].astype(np.int32),
        mesh.outer[:0],
        mesh.protrusions,
        mesh.protrusion_taxel,
        np.zeros(10, bool),
        np.zeros(10, bool),
    )
    corners = one.nodes[:4]
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    one.nodes[4:] = [(corners[a] + corners[b]) / 2 for a, b in pairs]
    part = replace(body, elastic=Elasticity(one, body.elastic.law)).energy(batch(one.nodes @ stretch)).item()
    assert whole == pytest.approx(part * 6 * 18, rel=1e-12)


def test_a_rigid_motion_costs_nothing(body, mesh):
    Q = random_rotation(np.random.default_rng(5))
    u = batch(mesh.nodes @ Q.T - mesh.nodes + [0.3, -0.2, 0.1])
    force, ratio = body.force(u)
    assert force.abs().max().item() < 1e-13
    assert body.energy(u).item() == pytest.approx(0, abs=1e-12)
    assert ratio.item() == pytest.approx(1, abs=1e-12)


def test_force_is_the_derivative_of_energy(body, mesh):
    u, p, h = wobble(mesh, 1), wobble(mesh, 2), 1e-5
    energy = body.energy(batch(u + h * p, u - h * p))
    force = body.force(batch(u))[0]
    assert (force * batch(p)).sum().item() == pytest.approx(((energy[0] - energy[1]) / (2 * h)).item(), rel=1e-7)


def test_tangent_is_the_derivative_of_force(body, mesh):
    u, p, h = wobble(mesh, 1), wobble(mesh, 2), 1e-6
    force = body.force(batch(u + h * p, u - h * p))[0]
    product = body.product(batch(u), batch(p))[..., 0]
    difference = (force[..., 0] - force[..., 1]) / (2 * h)
    assert (product - difference).abs().max().item() < 1e-7 * product.abs().max().item()


def test_tangent_is_symmetric(body, mesh):
    u, p, q = (batch(wobble(mesh, seed)) for seed in (1, 2, 3))
    kp, kq = body.product(u, p), body.product(u, q)
    assert (q * kp).sum().item() == pytest.approx((p * kq).sum().item(), rel=1e-11)


def test_forces_and_moments_of_a_body_on_its_own_vanish(body, mesh):
    u = wobble(mesh, 4)
    force = body.force(batch(u))[0][..., 0].numpy()
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * scale * len(force)
    assert np.abs(np.cross(mesh.nodes + u, force).sum(axis=0)).max() < 1e-13 * scale * len(force)


def test_members_of_a_batch_do_not_touch_each_other(body, mesh):
    a, b = wobble(mesh, 1), wobble(mesh, 2)
    together = body.force(batch(a, b))[0]
    for column, alone in enumerate((a, b)):
        assert (body.force(batch(alone))[0][..., 0] - together[..., column]).abs().max().item() < 1e-14


def test_an_inverted_element_shows_in_the_smallest_volume_ratio(body, mesh):
    assert body.force(batch(mesh.nodes @ np.diag([0.0, 0.0, -1.2])))[1].item() == pytest.approx(-0.2)


def test_an_inverted_member_leaves_its_neighbour_alone(body, mesh):
    good, inverted = wobble(mesh, 1), mesh.nodes @ np.diag([0.0, 0.0, -1.2])
    force, ratio = body.force(batch(inverted, good))
    assert (force[..., 1] - body.force(batch(good))[0][..., 0]).abs().max().item() < 1e-14
    assert ratio[1].item() == pytest.approx(body.force(batch(good))[1].item())


def test_single_precision_gives_the_same_force_and_product(body, mesh):
    """To some units in the last place (2^-24 = 6e-8), summed over 20 to 40 elements at a node, nu = 0.47."""
    u, p = batch(wobble(mesh, 1)), batch(wobble(mesh, 2))
    force, product = body.force(u)[0], body.product(u, p)
    single, ratio = body.force(u.float())
    assert single.dtype == ratio.dtype == torch.float32
    assert (single.double() - force).abs().max().item() < 1e-5 * force.abs().max().item()
    assert (body.product(u.float(), p.float()).double() - product).abs().max() < 1e-5 * product.abs().max()


def test_single_precision_keeps_its_digits_at_small_strains(body, mesh):
    """Strains of 1e-4, as at the rim of a shallow press: forces from F itself would keep three digits."""
    u = batch(wobble(mesh, 1, size=1e-4))
    force = body.force(u)[0]
    assert (body.force(u.float())[0].double() - force).abs().max() < 1e-4 * force.abs().max()


def test_every_member_has_its_own_modulus(body, mesh):
    """Force, tangent and energy are proportional to Young's modulus."""
    u = wobble(mesh, 1)
    law = body.elastic.law
    soft, stiff = (conditions(Material(law, modulus, 0.47), 0.0) for modulus in (0.15, 0.60))
    both = replace(body, member=joined(soft, stiff))
    force, energy = both.force(batch(u, u))[0], both.energy(batch(u, u))
    product = both.product(batch(u, u), batch(wobble(mesh, 2), wobble(mesh, 2)))
    assert torch.allclose(4 * force[..., 0], force[..., 1], rtol=1e-12, atol=1e-15)
    assert torch.allclose(4 * product[..., 0], product[..., 1], rtol=1e-11, atol=1e-14)
    assert energy[1].item() == pytest.approx(4 * energy[0].item(), rel=1e-12)
    assert both.elastic.internal_force(batch(u, u).float(), both.member)[0][..., 1].double() == pytest.approx(
        force[..., 1], abs=1e-5 * force.abs().max().item()
    )


def test_a_members_thickness_is_that_of_a_mesh_so_thick(body, mesh):
    """A slab 1.15 times as thick as its mesh behaves like a mesh whose heights are multiplied."""
    thick = replace(mesh, nodes=mesh.nodes * [1.0, 1.0, 1.15])
    other = made_of(thick, body.elastic.law)
    own = joined(conditions(Material(body.elastic.law, 0.30, 0.47), 0.0, thickness=1.15), body.member)
    scaled = replace(body, member=own)
    u, p = wobble(thick, 1), wobble(thick, 2)
    for ours, theirs in (
        (scaled.force(batch(u, u))[0], other.force(batch(u))[0]),
        (scaled.product(batch(u, u), batch(p, p)), other.product(batch(u), batch(p))),
        (scaled.energy(batch(u, u)), other.energy(batch(u))),
    ):
        assert (ours[..., 0] - theirs[..., 0]).abs().max() < 1e-12 * theirs.abs().max()
        assert (ours[..., 1] - theirs[..., 0]).abs().max() > 1e-3 * theirs.abs().max()
    assert scaled.force(batch(u, u))[1][0].item() == pytest.approx(other.force(batch(u))[1].item(), rel=1e-12)
