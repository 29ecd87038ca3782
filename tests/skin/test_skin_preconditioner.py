"""The rest stiffness, its factor, and the contact's share by the Woodbury identity."""

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata import registry
from tacdata.indenters.sphere import Sphere
from tacdata.sensor.sensor import Material
from tacdata.skin.compliance import Compliance, ContactPreconditioner
from tacdata.skin.contact import Contact, face_quadrature
from tacdata.skin.elasticity import Elasticity
from tacdata.skin.preconditioner import RestFactor, rest_stiffness

MATERIAL = Material("neo_hookean", 0.30, 0.47)


class Body:
    """A slab of 4 x 4 x 2 cells, bottom held, with everything that a press needs."""

    def __init__(self):
        self.mesh = box_mesh(slab_sensor(size=4.0), 4, 4, 2)
        self.count = len(self.mesh.nodes)
        self.stiffness = rest_stiffness(self.mesh, MATERIAL)
        self.free = np.flatnonzero(~np.repeat(self.mesh.bottom, 3))
        self.factor = RestFactor(self.stiffness, self.free)
        top = np.unique(self.mesh.outer)
        self.dofs = (3 * top[:, None] + np.arange(3)).ravel()
        self.compliance = Compliance.of(self.factor, self.count, self.dofs)

    def random(self, seed):
        field = np.random.default_rng(seed).normal(size=(1, self.count, 3))
        field.reshape(-1)[np.setdiff1d(np.arange(3 * self.count), self.free)] = 0
        return torch.as_tensor(field)


@pytest.fixture(scope="module")
def body():
    return Body()


@pytest.mark.parametrize("law", registry.names("tacdata.skin.materials", "law"))
def test_the_rest_stiffness_is_every_laws_tangent_at_rest(body, law):
    elastic, p = Elasticity(body.mesh, Material(law, 0.30, 0.47)), body.random(1)
    product = torch.zeros_like(p)
    elastic.tangent_product(torch.zeros_like(p), p, product)
    assembled = body.stiffness @ p.numpy().ravel()
    assert np.abs(product.numpy().ravel() - assembled).max() < 1e-12 * np.abs(assembled).max()


def test_the_factor_solves_to_single_precision_and_keeps_held_nodes(body):
    r = body.random(2)
    x = body.factor.apply(r).numpy().ravel()
    back = (body.stiffness @ x)[body.free]
    assert np.linalg.norm(back - r.numpy().ravel()[body.free]) < 1e-3 * r.norm().item()
    assert not np.delete(x, body.free).any()


def test_several_right_hand_sides_give_the_same_as_one_by_one(body):
    a, b = body.random(3), body.random(4)
    together = body.factor.apply(torch.cat([a, b]))
    for one, joint in zip((a, b), together, strict=True):
        assert (body.factor.apply(one)[0] - joint).norm() < 1e-4 * joint.norm()


def test_compliance_is_what_a_unit_force_moves(body):
    unit = torch.zeros(1, body.count, 3, dtype=torch.float64)
    unit.reshape(-1)[body.dofs[5]] = 1.0
    moved = body.factor.apply(unit).reshape(-1)
    assert (body.compliance.response[5].double() - moved).norm() < 1e-5 * moved.norm()
    assert torch.equal(body.compliance.matrix, body.compliance.matrix.T)
    assert torch.linalg.eigvalsh(body.compliance.matrix).min() > -1e-4


def test_joining_two_halves_gives_the_whole(body):
    first, second = np.array_split(body.dofs, 2)
    joined = Compliance.of(body.factor, body.count, first).join(Compliance.of(body.factor, body.count, second))
    assert torch.equal(joined.dofs, body.compliance.dofs)
    assert (joined.matrix - body.compliance.matrix).abs().max() < 1e-5 * body.compliance.matrix.abs().max()


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_with_contact_the_preconditioner_inverts_rest_plus_contact_stiffness(body, friction):
    nodes, faces = torch.as_tensor(body.mesh.nodes), torch.as_tensor(body.mesh.outer)
    weights, shapes = face_quadrature(nodes, faces, 1)
    sphere = Sphere(2.0)
    contact = Contact(
        nodes, faces, weights, shapes, sphere.distance_function(), sphere.parameters, friction, 900.0, 30.0
    )
    pose = torch.tensor([[0.1, -0.2, 1.9, 0.0]], dtype=torch.float64)
    contact.add_force(torch.zeros_like(body.random(0)), pose, contact.start(pose), torch.zeros_like(body.random(0)))
    preconditioner = ContactPreconditioner(body.factor, body.compliance, body.count)
    preconditioner.update([contact])
    x = body.random(5)
    r = torch.as_tensor(body.stiffness @ x.numpy().ravel()).reshape(x.shape)
    without = body.factor.apply(r)
    contact.add_product(x, r)
    r.reshape(-1)[np.setdiff1d(np.arange(3 * body.count), body.free)] = 0
    assert (preconditioner.apply(r) - x).norm() < 2e-2 * x.norm()
    assert (body.factor.apply(r) - x).norm() > 10 * x.norm()
    assert (without - x).norm() < 1e-2 * x.norm()
