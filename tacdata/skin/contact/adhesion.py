# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Adhesion of the outer face to a rigid shape: attractive traction by gap, integrated over the faces.

Traction pulls along the shape's normal and is per undeformed area. Contact (`tacdata.skin.contact.contact`) keeps
the surfaces
from passing through each other; this adds the attraction, where they touch too. Falling traction is a negative
stiffness: it is left out far from the solution, where the rest is a majorant, so that Newton's steps go down in energy
even through a jump, and taken near it.
"""

from functools import cache

import torch
import warp as wp

from tacdata.sensor import Adhesion
from tacdata.skin.adhesions import load_adhesion_law
from tacdata.skin.contact.contact import Contact, ContactState, Parameters
from tacdata.skin.elasticity.body import REAL
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import handed

_PER_MM = 1e-3
"""J/m^2 in N/mm [1]."""


@cache
def _pull(distance, law: str):
    """Compile the kernel of forces for one shape and one law."""
    shape, slope, rest = load_adhesion_law(law).functions()

    @wp.kernel(module="unique", enable_backward=False)
    def pull(
        u: wp.array3d(dtype=wp.float64), nodes: wp.array2d(dtype=wp.float64), faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=wp.float64), weights: wp.array2d(dtype=wp.float64),
        thickness: wp.array(dtype=wp.float64), parameters: wp.array2d(dtype=wp.float64),
        place: wp.array2d(dtype=wp.float64), turn: wp.array3d(dtype=wp.float64),
        strength: wp.float64, length: wp.float64, reach: wp.float64, sharp: wp.array(dtype=wp.float64),
        force: wp.array3d(dtype=wp.float64), stiffness: wp.array4d(dtype=wp.float64),
        energy: wp.array(dtype=wp.float64),
    ):
        f, k, b = wp.tid()
        zero = wp.float64(0.0)
        for i in range(4):
            stiffness[f, k, i, b] = zero
        q = Parameters()
        for i in range(8):
            q[i] = parameters[i, b]
        R = wp.mat33d(
            turn[0, 0, b], turn[0, 1, b], turn[0, 2, b], turn[1, 0, b], turn[1, 1, b], turn[1, 2, b],
            turn[2, 0, b], turn[2, 1, b], turn[2, 2, b],
        )
        x = wp.vec3d()
        for a in range(6):
            n = faces[f, a]
            z = nodes[n, 2]
            if z > zero:
                z = z * thickness[b]
            x += shapes[k, a] * wp.vec3d(nodes[n, 0] + u[n, 0, b], nodes[n, 1] + u[n, 1, b], z + u[n, 2, b])
        local = wp.transpose(R) * (x - wp.vec3d(place[0, b], place[1, b], place[2, b]))
        g = distance(local, q)
        if g < reach * length:
            h = wp.float64(1.0e-6)
            normal = R * wp.normalize(wp.vec3d(
                distance(local + wp.vec3d(h, zero, zero), q) - distance(local - wp.vec3d(h, zero, zero), q),
                distance(local + wp.vec3d(zero, h, zero), q) - distance(local - wp.vec3d(zero, h, zero), q),
                distance(local + wp.vec3d(zero, zero, h), q) - distance(local - wp.vec3d(zero, zero, h), q),
            ))
            s = wp.max(g, zero) / length
            t = strength * shape(s)
            wp.atomic_add(energy, b, weights[f, k] * (t * wp.min(g, zero) - strength * length * rest(s)))
            if g > zero:
                along = strength * slope(s) / length
                if along < zero:
                    along = along * sharp[b]
                stiffness[f, k, 0, b] = along
                for i in range(3):
                    stiffness[f, k, i + 1, b] = normal[i]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(force, faces[f, a], i, b, -shapes[k, a] * weights[f, k] * t * normal[i])

    return pull


@cache
def _product(real: type):
    """Compile the kernel that applies the stiffness, in one precision."""
    vec3 = wp.types.vector(3, real)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        p: wp.array3d(dtype=real), faces: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real), stiffness: wp.array4d(dtype=wp.float64), result: wp.array3d(dtype=real),
    ):
        f, k, b = wp.tid()
        along = real(stiffness[f, k, 0, b])
        if along != real(0.0):
            n = vec3(real(stiffness[f, k, 1, b]), real(stiffness[f, k, 2, b]), real(stiffness[f, k, 3, b]))
            moved = real(0.0)
            for a in range(6):
                for i in range(3):
                    moved += shapes[k, a] * p[faces[f, a], i, b] * n[i]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(result, faces[f, a], i, b, shapes[k, a] * weights[f, k] * along * moved * n[i])

    return product


class AdhesiveContact(Contact):
    """Contact of the outer face with a shape that it sticks to."""

    _STIFF = (*Contact._STIFF, "_pull_stiffness")
    _FOUND = (*Contact._FOUND, "_pull_stiffness", "energy")

    def __init__(
        self, nodes: torch.Tensor, faces: torch.Tensor, distance: wp.Function, rough: bool, penalty: float,
        stick: float, adhesion: Adhesion,
    ) -> None:
        """Bind faces of the mesh, a shape and a law; for the other arguments see `Contact`.

        Raises:
            UsageError: If there is no such law.
        """
        super().__init__(nodes, faces, 1, distance, rough, penalty, stick)
        law = load_adhesion_law(adhesion.law)
        self._pull = _pull(distance, adhesion.law)
        self._numbers = (adhesion.work * _PER_MM / adhesion.range, adhesion.range, law.reach)
        self._pull_stiffness = torch.empty(0)
        self.energy = torch.empty(0)
        """Potential of the attraction at the state last evaluated [N mm], 0 when parted, shape (b,)."""

    def start(self, pose: Pose) -> ContactState:
        """Return the state without contact, the shape at ``pose``; sizes the contact for the batch."""
        batch, device = pose.place.shape[1], self.nodes.device
        self._pull_stiffness = torch.zeros(*self.weights.shape, 4, batch, dtype=torch.float64, device=device)
        return super().start(pose)

    def add_force(
        self, u: torch.Tensor, pose: Pose, state: ContactState, conditions: Conditions, force: torch.Tensor
    ) -> None:
        """Add the nodal forces of contact and attraction on the skin [N] to ``force`` (n, 3, b)."""
        super().add_force(u, pose, state, conditions, force)
        nodal, batch = torch.zeros_like(force), u.shape[2]
        self.energy = torch.zeros(batch, dtype=torch.float64, device=u.device)
        inputs = [
            u, self.nodes, self.faces, self.shapes, self.weights, conditions.thickness, conditions.indenter, pose.place,
            pose.turn, *self._numbers, self.sharp,
        ]
        wp.launch(
            self._pull, dim=(*self.weights.shape, batch), inputs=[handed(value) for value in inputs],
            outputs=[handed(value) for value in (nodal, self._pull_stiffness, self.energy)], device=str(u.device),
        )
        self.force = self.force + nodal.sum(dim=0)
        force += nodal

    def add_product(self, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the stiffness times ``p`` [N] to ``result``; both of shape (n, 3, b) and of one precision."""
        super().add_product(p, result)
        shapes, weights = self._rule[p.dtype]
        wp.launch(
            _product(REAL[p.dtype]), dim=(*weights.shape, p.shape[2]),
            inputs=[handed(value) for value in (p, self.faces, shapes, weights, self._pull_stiffness)],
            outputs=[handed(result)], device=str(p.device),
        )
