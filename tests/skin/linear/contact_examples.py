"""Spheres pressed into a held slab, each member otherwise: the linear systems of one Newton step."""

from dataclasses import replace

import numpy as np
import torch
from skin_examples import MATERIAL, HeldSlab, batch, joined

from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose

SPHERE = Sphere(2.0)


class PressedSlab:
    """One contact with a sphere a member, its tangent, and the preconditioner for it."""

    def __init__(self, body: HeldSlab, rest, friction: float, places, moduli) -> None:
        """Press; ``places`` are those of the spheres' lowest points [mm], ``moduli`` Young's moduli [MPa]."""
        nodes, faces = torch.as_tensor(body.mesh.nodes), torch.as_tensor(body.mesh.outer)
        held = torch.as_tensor(body.mesh.bottom)
        self.surface = ContactSurface(nodes, faces, held, {0.0: SPHERE.distance_function()}, friction > 0, 10.0, 30.0)
        self.conditions = joined(*(conditions(replace(MATERIAL, youngs_modulus=e), friction, SPHERE) for e in moduli))
        count = len(places)
        turn = torch.eye(3, dtype=torch.float64)[:, :, None].repeat(1, 1, count)
        self.pose = Pose(torch.tensor(places, dtype=torch.float64).T.contiguous(), turn)
        self.history = self.surface.start(self.pose)
        self.u = batch(*[np.zeros_like(body.mesh.nodes)] * count)
        self.u[:, 0] = 1e-3 * self.u.new_tensor(body.mesh.nodes[:, 2])[:, None]  # So that friction holds something.
        self.multiplier = torch.full((self.surface.count, count), 0.02, dtype=torch.float64)
        none = torch.zeros(count, dtype=torch.float64)
        self.near, self.secant = none, none
        gap = self.forces().gap
        self.multiplier = torch.where(gap < 0, 0.02, 0.0)
        self.tangent = self.forces().tangent
        self.preconditioner = ConstraintPreconditioner(rest, [self.surface], MATERIAL.youngs_modulus)
        self.preconditioner.update([self.tangent], self.conditions.modulus)

    def forces(self):
        return self.surface.add_forces(
            self.u,
            self.multiplier,
            self.pose,
            self.history,
            self.conditions,
            self.secant,
            self.near,
            torch.zeros_like(self.u),
        )
