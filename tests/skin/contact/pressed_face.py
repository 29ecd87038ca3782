"""The outer face of a slab under a rigid shape, with multipliers that a test gives or makes up."""

import numpy as np
import torch
from skin_examples import batch, box_mesh, joined, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.sensor.sensor import Material
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.kernels import board_distance
from tacdata.skin.member.conditions import conditions
from tacdata.skin.member.pose import Pose, turned

MATERIAL = Material("neo_hookean", 0.30, 0.47)
STICK, ACTIVATION = 30.0, 10.0
"""The skin model's tangential stiffness [MPa/mm], and its weight of gaps over the modulus [1/mm]."""
STIFF = 1000.0
"""Pressure by penetration over the modulus [1/mm], by which tests make up multipliers."""
EYE = torch.eye(3, dtype=torch.float64)[:, :, None]
CELLS = 6
SPACING = 4.0 / CELLS / 2
"""Of the nodes of the face, corners and mid-sides [mm]."""


def slab_mesh():
    """A slab of 4 x 4 x 2 mm."""
    return box_mesh(slab_sensor(size=4.0), CELLS, CELLS, 2)


class Pressed:
    """A contact with the members' own conditions, so that a test names each thing once."""

    def __init__(self, mesh, *members, distance=None, rough=True, held=None):
        nodes, faces = torch.as_tensor(mesh.nodes), torch.as_tensor(mesh.outer)
        function, modulus = distance or Sphere(2.0).distance_function(), MATERIAL.youngs_modulus
        held = torch.zeros(len(nodes), dtype=torch.bool) if held is None else torch.as_tensor(held)
        flat = function is board_distance
        self.surface = ContactSurface(nodes, faces, held, {0.0: function}, rough, ACTIVATION, STICK / modulus, flat)
        self.conditions, self.mesh = joined(*members), mesh
        self.start, self.tangent, self.near = self.surface.start, 0.0, 0.0

    def force(self, u, pose, history, multiplier):
        """Nodal forces of multipliers; ``now`` keeps the tractions."""
        force, every = torch.zeros_like(u), torch.ones_like(self.conditions.modulus)
        self.now = self.surface.add_forces(
            u, multiplier, pose, history, self.conditions, self.tangent * every, self.near * every, force
        )
        return force

    def press(self, u, pose, history):
        """The same, with multipliers that grow with the penetration."""
        self.force(u, pose, history, self.even(0.0))
        self.multiplier = STIFF * self.conditions.modulus * (-self.now.gap).clamp_min(0.0)
        return self.force(u, pose, history, self.multiplier)

    def product(self, p):
        result = torch.zeros_like(p)
        self.surface.add_product(self.now.tangent, p, result)
        return result

    def slope(self, u, pose, history, multiplier, p, h):
        """Change of the forces along ``p`` by central differences of step ``h``, at fixed multipliers."""
        up, down = (self.force(u + sign * h * p, pose, history, multiplier) for sign in (1, -1))
        self.force(u, pose, history, multiplier)
        return (up - down) / (2 * h)

    def misfit(self):
        return [value.tolist() for value in self.surface.penetration(self.now)]

    def flat(self, height=2.0):
        """Displacements of the skin at rest, or with its face at another height [mm]."""
        u = batch(*[np.zeros_like(self.mesh.nodes)] * len(self.conditions.modulus))
        u[:, 2] = height - 2.0
        return u

    def even(self, pressure):
        """The same multiplier at every node."""
        return torch.full((self.surface.count, len(self.conditions.modulus)), pressure, dtype=torch.float64)


def against(mesh, friction, shape=None):
    """A sphere, or another shape, of one member."""
    shape = shape or Sphere(2.0)
    return Pressed(mesh, conditions(MATERIAL, friction, shape), distance=shape.distance_function())


def against_board(mesh, friction=0.0, **more):
    return Pressed(mesh, conditions(MATERIAL, friction), distance=board_distance, **more)


def at(x=0.0, y=0.0, z=0.0, turn=EYE):
    return Pose(torch.tensor([[x], [y], [z]], dtype=torch.float64), turn.clone())


def pose_at(x=0.0, y=0.0, depth=0.1, **angles):
    """Of a shape whose lowest point is ``depth`` below the face; angles [rad]."""
    return at(x, y, 2.0 - depth, turn_by(**angles))


def turn_by(yaw=0.0, tilt_x=0.0, tilt_y=0.0):
    return turned(*(torch.tensor([angle], dtype=torch.float64) for angle in (yaw, tilt_x, tilt_y)))


def everyone(pose):
    return torch.ones(pose.place.shape[1], dtype=torch.bool)


def side_by_side(*poses):
    return Pose(
        torch.cat([pose.place for pose in poses], dim=1).contiguous(),
        torch.cat([pose.turn for pose in poses], dim=2).contiguous(),
    )
