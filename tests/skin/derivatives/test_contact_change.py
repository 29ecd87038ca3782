"""Derivatives of one contact against central differences of its forces, and the preconditioner of their solves."""

from dataclasses import fields, replace

import numpy as np
import pytest
import scipy.sparse as sp
import torch
from skin_examples import HeldSlab, batch, slab_sensor

from tacdata.indenters.ellipsoid import Ellipsoid
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.derivatives.contact import ConditionsChange, ContactPoint, contact_change
from tacdata.skin.derivatives.state_preconditioner import StatePreconditioner
from tacdata.skin.linear.rest_stiffness import SparseRest
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose, turned

EGG = Ellipsoid(3.0, 2.0, 1.5)
STEP = 1e-4
"""Of the differences; the shape's normal is good to 4e-10, which a smaller step would show."""
ONE = torch.ones(1, dtype=torch.float64)


class Dent:
    """An egg pressed into a slab that was dented by it a little before: nodes stick, slip, and are just reached."""

    def __init__(self):
        """Place it; tractions are made up."""
        self.held = HeldSlab()
        nodes, faces = torch.as_tensor(self.held.mesh.nodes), torch.as_tensor(self.held.mesh.outer)
        clamped = torch.as_tensor(self.held.mesh.bottom)
        self.surface = ContactSurface(nodes, faces, clamped, {0.0: EGG.distance_function()}, True, 10.0, 3.0)
        self.conditions = conditions(slab_sensor().material, 0.3, EGG)
        angles = (torch.tensor([angle], dtype=torch.float64) for angle in (0.3, 0.05, -0.04))
        self.pose = Pose(torch.tensor([[0.11], [-0.17], [1.7]], dtype=torch.float64), turned(*angles))
        random = np.random.default_rng(3)
        dent = -0.25 * np.exp(-(self.held.mesh.nodes[:, :2] ** 2).sum(axis=1)) * self.held.mesh.nodes[:, 2] / 2
        u = 0.02 * random.normal(size=self.held.mesh.nodes.shape)
        u[:, 2] = dent
        self.u = batch(u)
        start = self.surface.start(self.pose)
        earlier = Pose(self.pose.place + torch.tensor([[0.02], [0.01], [0.1]]), self.pose.turn)
        nothing = torch.zeros(self.surface.count, 1, dtype=torch.float64)
        before = self._forces(0.8 * self.u, nothing, self.conditions, earlier, start)
        anchor = before.local + 0.01 * torch.as_tensor(random.normal(size=(self.surface.count, 3, 1)))
        shear = 0.01 * torch.as_tensor(random.normal(size=(self.surface.count, 3, 1)))
        gap = torch.where(before.gap < 0.03, 0.0, before.gap)
        self.history = ContactHistory(anchor, shear, gap, earlier.place)
        middle = torch.as_tensor(self.held.mesh.nodes[self.surface.mortar.nodes])
        reached = torch.linalg.vector_norm(middle[:, :2], dim=1) < 1.1
        self.pressure = torch.where(reached, 0.1 + 0.05 * torch.as_tensor(random.random(len(reached))), -1.0)[:, None]
        self.now = self._forces(self.u, self.pressure, self.conditions, self.pose, self.history)

    def _forces(self, u, pressure, own, pose, history):
        total = torch.zeros_like(u)
        found = self.surface.add_forces(u, pressure, pose, history, own, ONE, 0 * ONE, total)
        self.total = total
        return found

    def moved(self, step, du, pressure, change, history):
        """Nodal forces and what contact says, with everything moved by a step along the direction."""
        found = self._forces(
            self.u + step * du,
            self.pressure + step * pressure,
            plus(self.conditions, step, change.conditions),
            plus(self.pose, step, change.pose),
            plus(self.history, step, history),
        )
        return self.total, found


def plus(value, step, change):
    parts = (getattr(value, f.name) + step * getattr(change, f.name) for f in fields(value))
    return type(value)(*parts)


@pytest.fixture(scope="module")
def dent():
    return Dent()


def random_like(value, random, size=1.0):
    return type(value)(
        *(size * torch.as_tensor(random.normal(size=tuple(getattr(value, f.name).shape))) for f in fields(value))
    )


def test_everything_that_contact_depends_on_moves_it_as_differences_say(dent):
    active, slips = dent.now.tangent.active, dent.now.shear.norm(dim=1) >= 0.3 * dent.now.pressure - 1e-12
    opened = dent.history.gap > 0
    assert (active & slips).any() and (active & ~slips).any() and (active & opened).any() and (~active).any()
    random = np.random.default_rng(5)
    du = batch(0.3 * random.normal(size=dent.held.mesh.nodes.shape))
    pressure = torch.as_tensor(0.1 * random.normal(size=dent.pressure.shape))
    own = random_like(dent.conditions, random, 0.1)
    own = replace(own, law=torch.zeros_like(own.law))
    # The eggs' sizes change; what follows them in the list is unused.
    own.indenter[3:] = 0.0
    turn = torch.as_tensor(np.cross(np.eye(3), [0.2, -0.1, 0.3])) @ dent.pose.turn[..., 0]
    change = ConditionsChange(own, Pose(torch.as_tensor(random.normal(size=(3, 1))), turn[..., None]))
    history = random_like(dent.history, random, 0.1)
    # What was closed stays so: beyond 0 a gap counts from the moment at which it is closed.
    history.gap[dent.history.gap == 0] = 0.0
    point = ContactPoint(dent.pose, dent.history, dent.now)
    found = contact_change(dent.surface, dent.u, dent.conditions, point, du, pressure, change, history)
    (up, above), (down, below) = (dent.moved(sign * STEP, du, pressure, change, history) for sign in (1, -1))
    assert torch.equal(above.tangent.active, below.tangent.active)
    wanted = {"force": (up - down) / (2 * STEP)}
    for name in ("gap", "pressure", "shear", "local"):
        wanted[name] = (getattr(above, name) - getattr(below, name)) / (2 * STEP)
    for name, value in wanted.items():
        got = getattr(found, name)
        assert (got - value).abs().max() < 1e-5 * value.abs().max(), name
    assert torch.allclose(found.load, found.pressure * dent.surface.area[:, None])
    # Without open nodes' gaps, the rest is the same.
    part = contact_change(dent.surface, dent.u, dent.conditions, point, du, pressure, change, history, full=False)
    assert torch.allclose(part.force, found.force) and torch.allclose(part.gap[active], found.gap[active])


def test_the_preconditioner_closes_gaps_and_lets_friction_follow(dent):
    """z balances r with the forces; gaps change by g; friction resists slip, and grows with pressure where it slips."""
    held, surface = dent.held, dent.surface
    rows = sp.csr_matrix(sp.kron(surface.mortar.mean, np.eye(3)))
    rest = SparseRest(held.stiffness, held.free, rows)
    own = StatePreconditioner(rest, [surface], [dent.now], 0.3 * ONE, [dent.pose.turn])
    r, random = held.random(1, 2), np.random.default_rng(6)
    gaps = torch.as_tensor(random.normal(size=(surface.count, 2))).float()
    z, normal = own.apply(r, gaps)
    active = dent.now.tangent.active[:, 0]
    slips = torch.as_tensor(rows @ z.double().numpy()).reshape(surface.count, 3, 2)
    along = dent.now.tangent.normal
    closed = (along * slips).sum(dim=1)[active]
    assert torch.allclose(closed, gaps[active].double(), atol=1e-3 * float(gaps.abs().max()))
    assert not normal[~active].any()
    packed = dent.now.tangent.friction[:, [0, 3, 5, 3, 1, 4, 5, 4, 2], 0].unflatten(1, (3, 3))
    shear = torch.einsum("ij,sj->si", dent.pose.turn[..., 0], dent.now.shear[..., 0])
    slipping = (shear.norm(dim=1) >= 0.3 * dent.now.pressure[:, 0] - 1e-12) & active
    grows = torch.where(slipping[:, None], 0.3 * shear / shear.norm(dim=1, keepdim=True).clamp_min(1e-30), 0.0)
    hats = normal[:, None].double() * (along + grows[..., None]) - torch.einsum("sij,sjc->sic", packed, slips)
    balance = held.times(z) - r - torch.as_tensor(rows.T @ (hats * active[:, None, None]).reshape(-1, 2).numpy())
    balance[held.held] = 0
    assert balance.norm() < 1e-3 * r.norm()
