"""Adhesion of the outer face to a rigid shape: attractive traction by gap, integrated over the faces.

Traction pulls along the shape's normal and is per undeformed area. Contact (`contact_surface`) keeps the surfaces from
passing through each other. This adds the attraction, also where they touch. Falling traction is a negative stiffness:
it is left out far from the solution, where the rest is a majorant. So Newton's steps go down in energy even through a
jump.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import torch

from tacdata.sensor import Adhesion
from tacdata.skin.adhesions import load_adhesion_law
from tacdata.skin.contact.contact_forces import ContactForces, ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.contact.kernel_data import MemberData, SurfaceData, member_data
from tacdata.skin.contact.kernels import deformed_point, normal_function, of_member, parameters_of, rotation_of
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.warp_runtime import wp

_PER_MM = 1e-3
"""J/m^2 in N/mm [1]."""


@wp.struct
class AdhesionData:
    """Work over range [MPa], range [mm], and the gap over the range from which on nothing pulls [1]."""

    strength: wp.float64
    length: wp.float64
    reach: wp.float64


@cache
def _pull(distance, law: str):
    """Compile the kernel of forces for one shape and one law."""
    shape, slope, reserve = load_adhesion_law(law).functions()

    normal = normal_function(distance)

    @wp.kernel(module="unique", enable_backward=False)
    def pull(
        u: wp.array3d(dtype=wp.float64),
        surface: SurfaceData,
        members: MemberData,
        adhesion: AdhesionData,
        chosen: wp.array(dtype=wp.int32),
        friction_tangent: wp.array(dtype=wp.float64),
        force: wp.array3d(dtype=wp.float64),
        stiffness: wp.array4d(dtype=wp.float64),
        energy: wp.array(dtype=wp.float64),
    ):
        """Attraction of one point, added to the nodes: gap, traction by the law, slope and normal for the stiffness."""
        f, k, c = wp.tid()
        b = chosen[c]
        zero = wp.float64(0.0)
        for i in range(4):
            stiffness[f, k, i, b] = zero
        q = parameters_of(members.indenter, b)
        R = rotation_of(members.turn, b)
        x = deformed_point(u, surface, f, k, b, members.thickness[b])
        local = wp.transpose(R) * (x - of_member(members.place, b))
        g = distance(local, q)
        strength, length, weight = adhesion.strength, adhesion.length, surface.weights[f, k]
        if g < adhesion.reach * length:
            n = R * normal(local, q)
            s = wp.max(g, zero) / length
            t = strength * shape(s)
            # Inside the shape the traction stays that of gap 0, so the potential continues linearly.
            wp.atomic_add(energy, b, weight * (t * wp.min(g, zero) - strength * length * reserve(s)))
            if g > zero:
                stiffness_along = strength * slope(s) / length
                # Without it the stiffness is that of a majorant, and steps go down in energy (0013).
                if stiffness_along < zero:
                    stiffness_along = stiffness_along * friction_tangent[b]
                stiffness[f, k, 0, b] = stiffness_along
                for i in range(3):
                    stiffness[f, k, i + 1, b] = n[i]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(force, surface.faces[f, a], i, b, -surface.shapes[k, a] * weight * t * n[i])

    return pull


@cache
def _product(real: type):
    """Compile the kernel that applies the stiffness, in one precision."""
    vec3 = wp.types.vector(3, real)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        p: wp.array3d(dtype=real),
        faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real),
        stiffness: wp.array4d(dtype=wp.float64),
        result: wp.array3d(dtype=real),
    ):
        f, k, b = wp.tid()
        stiffness_along = real(stiffness[f, k, 0, b])
        if stiffness_along != real(0.0):
            n = vec3(real(stiffness[f, k, 1, b]), real(stiffness[f, k, 2, b]), real(stiffness[f, k, 3, b]))
            change = real(0.0)
            for a in range(6):
                for i in range(3):
                    change += shapes[k, a] * p[faces[f, a], i, b] * n[i]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(
                        result, faces[f, a], i, b, shapes[k, a] * weights[f, k] * stiffness_along * change * n[i]
                    )

    return product


class AdhesiveSurface(ContactSurface):
    """Contact of the outer face with a shape that it sticks to."""

    attracts = True

    def __init__(
        self,
        nodes: torch.Tensor,
        faces: torch.Tensor,
        fixed: torch.Tensor,
        distances: Mapping[float, wp.Function],
        frictional: bool,
        activation: float,
        stick: float,
        adhesion: Adhesion,
    ) -> None:
        """Bind faces of the mesh, shapes and a law; for the other arguments see `ContactSurface`.

        Raises:
            UsageError: If there is no such law.
        """
        super().__init__(nodes, faces, fixed, distances, frictional, activation, stick)
        self._law = adhesion.law
        self._adhesion = filled(
            AdhesionData,
            # Work of adhesion is the area under the curve of traction over gap, so its height is work over range.
            strength=adhesion.work * _PER_MM / adhesion.range,
            length=adhesion.range,
            reach=load_adhesion_law(adhesion.law).reach,
        )

    def add_forces(
        self,
        u: torch.Tensor,
        multiplier: torch.Tensor,
        pose: Pose,
        history: ContactHistory,
        conditions: Conditions,
        friction_tangent: torch.Tensor,
        near: torch.Tensor,
        total: torch.Tensor,
    ) -> ContactForces:
        """Add the nodal forces of contact and attraction on the skin [N], as `ContactSurface.add_forces`.

        Falling attraction enters the stiffness where ``friction_tangent`` is 1.
        """
        contact = super().add_forces(u, multiplier, pose, history, conditions, friction_tangent, near, total)
        nodal = torch.zeros_like(total)
        stiffness = torch.zeros(*self.weights.shape, 4, u.shape[2], dtype=torch.float64, device=u.device)
        energy = torch.zeros(u.shape[2], dtype=torch.float64, device=u.device)
        members = member_data(conditions, pose)
        for distance, chosen in self.by_shape(conditions):
            wp.launch(
                _pull(distance, self._law),
                dim=(*self.weights.shape, len(chosen)),
                inputs=[argument(u), self.data, members, self._adhesion, argument(chosen), argument(friction_tangent)],
                outputs=[argument(nodal), argument(stiffness), argument(energy)],
                device=self.device,
            )
        total += nodal
        tangent = replace(contact.tangent, attraction=stiffness)
        return replace(contact, force=contact.force + nodal.sum(dim=0), tangent=tangent, energy=energy)

    def add_product(self, at: ContactTangent, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the stiffness times ``p`` [N] to ``result``; both of shape (n, 3, b) and of one precision."""
        super().add_product(at, p, result)
        shapes, weights = self.rule[p.dtype]
        wp.launch(
            _product(REAL[p.dtype]),
            dim=(*weights.shape, p.shape[2]),
            inputs=[argument(value) for value in (p, self.faces, shapes, weights, at.attraction)],
            outputs=[argument(result)],
            device=self.device,
        )
