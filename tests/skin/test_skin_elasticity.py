"""Internal forces, energy and tangent of the body, free of contact."""

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, random_rotation, slab_sensor

from tacdata import registry
from tacdata.sensor.sensor import Material
from tacdata.skin.elasticity import Elasticity
from tacdata.skin.mesh import SkinMesh

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


@pytest.fixture(scope="module", params=LAWS)
def body(request, mesh):
    return Elasticity(mesh, Material(request.param, 0.30, 0.47))


def batch(*fields):
    return torch.as_tensor(np.stack(fields), dtype=torch.float64).contiguous()


def wobble(mesh, seed, size=0.1):
    """A smooth displacement with strains of about ``size``."""
    random = np.random.default_rng(seed)
    u = mesh.nodes @ random.uniform(-size, size, (3, 3))
    return u + size * np.sin(mesh.nodes @ random.uniform(-1, 1, (3, 3)))


def test_an_affine_displacement_leaves_inner_nodes_without_force(body, mesh):
    stretch = np.array([[0.1, 0.05, 0.0], [-0.08, -0.1, 0.02], [0.03, 0.0, 0.15]])
    force, ratio = body.internal_force(batch(mesh.nodes @ stretch.T))
    inner = ~surface(mesh)
    scale = force[0].abs().max().item()
    assert scale > 1e-3 and inner.sum() > 30
    assert force[0][inner].abs().max().item() < 1e-13 * max(1, 1 / scale)
    assert ratio.item() == pytest.approx(np.linalg.det(np.eye(3) + stretch), rel=1e-12)


def test_an_affine_displacement_has_the_energy_of_one_point(body, mesh):
    """Total energy = W(F) times the volume: the quadrature loses nothing."""
    stretch = np.diag([0.1, -0.05, 0.2])
    whole = body.energy(batch(mesh.nodes @ stretch)).item()
    one = SkinMesh(
        np.concatenate([np.eye(4)[:, 1:], np.zeros((6, 3))]), np.arange(10)[None].astype(np.int32), mesh.outer[:0],
        mesh.protrusions, mesh.protrusion_taxel, np.zeros(10, bool), np.zeros(10, bool),
    )
    corners = one.nodes[:4]
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    one.nodes[4:] = [(corners[a] + corners[b]) / 2 for a, b in pairs]
    part = Elasticity(one, body.material).energy(batch(one.nodes @ stretch)).item()
    assert whole == pytest.approx(part * 6 * 18, rel=1e-12)


def test_a_rigid_motion_costs_nothing(body, mesh):
    Q = random_rotation(np.random.default_rng(5))
    u = batch(mesh.nodes @ Q.T - mesh.nodes + [0.3, -0.2, 0.1])
    force, ratio = body.internal_force(u)
    assert force.abs().max().item() < 1e-13
    assert body.energy(u).item() == pytest.approx(0, abs=1e-12)
    assert ratio.item() == pytest.approx(1, abs=1e-12)


def test_force_is_the_derivative_of_energy(body, mesh):
    u, p, h = wobble(mesh, 1), wobble(mesh, 2), 1e-5
    energy = body.energy(batch(u + h * p, u - h * p))
    force = body.internal_force(batch(u))[0]
    assert (force * batch(p)).sum().item() == pytest.approx(((energy[0] - energy[1]) / (2 * h)).item(), rel=1e-7)


def test_tangent_is_the_derivative_of_force(body, mesh):
    u, p, h = wobble(mesh, 1), wobble(mesh, 2), 1e-6
    force = body.internal_force(batch(u + h * p, u - h * p))[0]
    product = torch.zeros(1, *u.shape, dtype=torch.float64)
    body.tangent_product(batch(u), batch(p), product)
    difference = (force[0] - force[1]) / (2 * h)
    assert (product[0] - difference).abs().max().item() < 1e-7 * product.abs().max().item()


def test_tangent_is_symmetric(body, mesh):
    u, p, q = (batch(wobble(mesh, seed)) for seed in (1, 2, 3))
    kp, kq = torch.zeros_like(p), torch.zeros_like(q)
    body.tangent_product(u, p, kp)
    body.tangent_product(u, q, kq)
    assert (q * kp).sum().item() == pytest.approx((p * kq).sum().item(), rel=1e-11)


def test_forces_and_moments_of_a_body_on_its_own_vanish(body, mesh):
    u = wobble(mesh, 4)
    force = body.internal_force(batch(u))[0][0].numpy()
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * scale * len(force)
    assert np.abs(np.cross(mesh.nodes + u, force).sum(axis=0)).max() < 1e-13 * scale * len(force)


def test_members_of_a_batch_do_not_touch_each_other(body, mesh):
    a, b = wobble(mesh, 1), wobble(mesh, 2)
    together = body.internal_force(batch(a, b))[0]
    for alone, joint in zip((a, b), together, strict=True):
        assert (body.internal_force(batch(alone))[0][0] - joint).abs().max().item() < 1e-14


def test_an_inverted_element_shows_in_the_smallest_volume_ratio(body, mesh):
    assert body.internal_force(batch(mesh.nodes @ np.diag([0.0, 0.0, -1.2])))[1].item() == pytest.approx(-0.2)
