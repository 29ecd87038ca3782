"""Contact of faces of the skin with rigid shapes: multipliers at nodes, Coulomb friction.

The normal traction is a piecewise linear field on the four sub-triangles of every quadratic face. Its values at the
nodes are unknowns (multipliers), as displacements are. A node either carries pressure, or the mean gap under its hat
is not negative. Node j is active where lambda_j - c gap_j > 0: the primal-dual active set (Hueeber and Wohlmuth,
Comput. Methods Appl. Mech. Eng. 194 (2005) 3147). It is a Newton method for functions with kinks (Hintermueller, Ito
and Kunisch, SIAM J. Optim. 13 (2002) 865).

Friction acts on the mean slip under each hat: a return mapping of the shear traction onto the disc of radius
mu lambda_j. Its history is that of the last equilibrium. Far from the solution friction enters the stiffness by its
secant (Kacanov's method), near it by the tangent. The derivative of the disc's radius is left out, so that the
stiffness stays symmetric. Tractions are per undeformed area.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import torch

from tacdata.skin.contact import kernel_data, kernels
from tacdata.skin.contact.contact_forces import ContactForces, ContactTangent
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.contact.mortar import Mortar
from tacdata.skin.contact.passage_check import passage_kernel
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.skin.mesh import elements
from tacdata.warp_runtime import wp

SUBDIVISIONS = 2
"""The quadrature rule is repeated on the sub-triangles of the hats, on which these are linear."""

_HELD = 1 - 1e-9
"""Largest shear over the friction limit at which a node sticks [1]; a slipping node is returned to 1."""


class ContactSurface:
    """Faces of the mesh against rigid shapes, one a member. It holds nothing that changes while presses are solved."""

    attracts = False
    """Whether it pulls where it does not touch."""

    def __init__(
        self,
        nodes: torch.Tensor,
        faces: torch.Tensor,
        fixed: torch.Tensor,
        distances: Mapping[float, wp.Function],
        frictional: bool,
        activation: float,
        stick: float,
        flat: bool = False,
    ) -> None:
        """Bind faces of the mesh and shapes.

        Args:
            nodes: Undeformed positions [mm], shape (n, 3).
            faces: Quadratic triangles, shape (f, 6), int32.
            fixed: Nodes that cannot move, shape (n,), bool; they carry no multiplier.
            distances: Signed distances of the shapes (`tacdata.indenters.indenter`), by their numbers
                (`tacdata.skin.member.conditions.shape_number`); of a single one the number is not asked for.
            frictional: Whether there is friction (its coefficient is each member's own).
            activation: c over Young's modulus: weight of a gap against a pressure in the active set [1/mm].
            stick: Tangential stiffness of sticking nodes over Young's modulus [1/mm].
            flat: Whether the shape's normal is the z axis everywhere.
        """
        self.faces, self.distances, self.device = faces, dict(distances), str(nodes.device)
        self.rough, self.activation, self.flat = frictional, activation, flat
        self.weights, self.shapes = face_quadrature(nodes, faces, SUBDIVISIONS)
        # Linear hats carry the multipliers of quadratic faces: with quadratic ones, pressures at corners have no
        # positive weight.
        at_points = elements.triangle_hats(elements.triangle_quadrature(SUBDIVISIONS)[0])
        self.mortar = Mortar(
            faces.cpu().numpy(),
            self.weights.cpu().numpy(),
            self.shapes.cpu().numpy(),
            at_points,
            len(nodes),
            self.device,
        )
        """The projection onto the hats."""
        self.area = torch.as_tensor(self.mortar.area, device=nodes.device)
        """Area of each hat, undeformed [mm^2], shape (s,)."""
        self._nodes = torch.as_tensor(self.mortar.nodes, device=nodes.device)
        self.able = ~fixed[self._nodes]
        """Nodes that may carry a multiplier, shape (s,), bool."""
        self._mean_nodes = self.mortar.means(nodes[:, :, None].contiguous())
        """Mean undeformed place under each hat [mm], shape (s, 3, 1)."""
        # Only the slab (z > 0) stretches with a member's thickness; protrusions keep their size, as in `Elasticity`.
        rise = torch.zeros_like(nodes)
        rise[:, 2] = nodes[:, 2].clamp_min(0.0)
        self._mean_rise = self.mortar.means(rise[:, :, None].contiguous())
        self.rule = {dtype: (self.shapes.to(dtype).contiguous(), self.weights.to(dtype).contiguous()) for dtype in REAL}
        """Shape functions, shape (k, 6), and weights [mm^2], shape (f, k), by precision."""
        slots = torch.as_tensor(self.mortar.slots.astype(np.int32), device=nodes.device)
        self._slots = slots
        self.data = filled(
            kernel_data.SurfaceData,
            nodes=nodes,
            faces=faces,
            slots=slots,
            shapes=self.shapes,
            hats=torch.as_tensor(at_points, device=nodes.device),
            weights=self.weights,
            area=self.area,
            stick=stick,
            rough=int(frictional),
        )
        """The same, as kernels take it."""

    @property
    def count(self) -> int:
        """Number of contact nodes."""
        return len(self.area)

    @property
    def only(self) -> wp.Function:
        """The distance function of a surface that has a single one."""
        [distance] = self.distances.values()
        return distance

    def by_shape(self, conditions: Conditions) -> Iterator[tuple[wp.Function, torch.Tensor]]:
        """Yield each shape's distance function and its members, by index, shape (k,), int32."""
        everyone = torch.arange(len(conditions.shape), dtype=torch.int32, device=conditions.shape.device)
        # A kernel is compiled for one shape, so a batch of mixed indenters is launched shape by shape.
        if len(self.distances) == 1:
            yield self.only, everyone
            return
        for number, distance in self.distances.items():
            if len(members := everyone[conditions.shape == number]):
                yield distance, members

    def start(self, pose: Pose) -> ContactHistory:
        """Return the history of members without contact, the shape at ``pose``."""
        place = pose.place.clone()
        # Infinite gaps keep friction out of the state at the touch; its gaps become the first history
        # (`Batch._touched`).
        gap = torch.full((self.count, place.shape[1]), torch.inf, dtype=torch.float64, device=place.device)
        anchor = torch.zeros(self.count, 3, place.shape[1], dtype=torch.float64, device=place.device)
        return ContactHistory(anchor, anchor.clone(), gap, place)

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
        """Add the contact's nodal forces on the skin [N] to ``total``, shape (n, 3, b).

        Args:
            u: Displacements [mm], shape (n, 3, b), float64.
            multiplier: Normal tractions at the nodes [MPa], shape (s, b); those of nodes that are not active are
                taken as 0.
            pose: Of the shape.
            history: Where friction starts from.
            conditions: Friction, thickness, modulus and the shape's parameters.
            friction_tangent: Stiffness of slipping nodes, from 0, the secant, to 1, the tangent, shape (b,).
            near: Gap up to which nodes without pressure are active, too [mm], shape (b,).
            total: Receives the forces.

        Returns:
            Gaps, tractions, their linearization, and the resultant.
        """
        count, b = self.count, u.shape[2]
        members = kernel_data.member_data(conditions, pose)
        pressed, place = list(self.by_shape(conditions)), self._mean_place(u, conditions)
        # The active set of a semismooth Newton method: a node is active where pressure less activation times gap is
        # positive.
        gap = self._gaps(u, place, pose, members, pressed)
        c = self.activation * conditions.modulus
        # The shift by ``near`` adds close nodes at the start of a load step, while their pressures are unknown (0019).
        active = (multiplier - c * (gap - near) > 0) & self.able[:, None]
        pressure = torch.where(active, multiplier, 0.0)
        nodal, normal = self._zeros(u, 3), self._zeros(u, 3)
        points = (0, 0) if self.flat else tuple(self.weights.shape)
        # Normals turn as the face moves. Above a plane they do not, and the term is left out.
        turn = torch.zeros(*points, 6, b, dtype=torch.float32, device=u.device)
        for distance, chosen in pressed:
            wp.launch(
                kernels.pressure_kernel(distance),
                dim=(len(self.faces), len(chosen)),
                inputs=[argument(u), self.data, members, argument(chosen), argument(pressure), argument(active)],
                outputs=[argument(nodal), argument(normal), int(not self.flat), argument(turn)],
                device=self.device,
            )
        # A mean of unit vectors is shorter than 1 under a curved shape, and 0 on faces out of contact.
        normal = normal / torch.linalg.vector_norm(normal, dim=1, keepdim=True).clamp_min(1e-12)
        local, shear, force, stiffness = (self._zeros(u, size) for size in (3, 3, 3, 6))
        wp.launch(
            kernels.friction,
            dim=(count, b),
            inputs=[
                argument(place),
                self.data,
                members,
                kernel_data.history_data(history),
                argument(pressure),
                argument(active),
                argument(normal),
                argument(friction_tangent),
            ],
            outputs=[argument(value) for value in (local, shear, force, stiffness)],
            device=self.device,
        )
        total.index_add_(0, self._nodes, nodal)
        resultant = nodal.sum(dim=0)
        if self.rough:
            self.mortar.spread(force, total)
            resultant += force.sum(dim=0)
        return ContactForces(resultant, gap, pressure, shear, local, ContactTangent(active, normal, stiffness, turn))

    def add_product(self, at: ContactTangent, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the contact's stiffness times ``p`` [N] to ``result``; both of shape (n, 3, b) and of one precision.

        That is friction, less the turn of normal forces.
        """
        if not self.flat:
            inputs = [p, self.faces, self._slots, self.rule[p.dtype][0], at.active, at.turn]
            wp.launch(
                kernels.turn_kernel(REAL[p.dtype]),
                dim=(len(self.faces), p.shape[2]),
                inputs=[argument(value) for value in inputs],
                outputs=[argument(result)],
                device=self.device,
            )
        if not self.rough:
            return
        slips = self.mortar.means(p)
        wp.launch(
            kernels.slip_kernel(REAL[p.dtype]),
            dim=(self.count, p.shape[2]),
            inputs=[argument(at.friction), argument(slips)],
            device=self.device,
        )
        self.mortar.spread(slips, result)

    def penetration(self, forces: ContactForces) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the largest error of the contact condition, and its mean weighted by the load [mm].

        That is the mean gap of nodes under pressure, in magnitude, and the penetration of all others. Both are of
        shape (b,).
        """
        violation = torch.where(
            forces.pressure > 0, forces.gap.abs(), (-forces.gap).clamp_min(0.0) * self.able[:, None]
        )
        # Pressures may be negative before Newton's method has converged.
        load = forces.pressure.abs() * self.area[:, None]
        mean = (load * violation).sum(dim=0) / load.sum(dim=0).clamp_min(1e-30)
        return violation.amax(dim=0), mean

    def status(self, forces: ContactForces, friction: torch.Tensor) -> torch.Tensor:
        """Return each node's status, shape (s, b), int8: 0 is open, 1 sticks, 2 slips; ``friction``: shape (b,)."""
        active = forces.tangent.active.to(torch.int8)
        if not self.rough:
            return active
        threshold = _HELD * friction * forces.pressure.clamp_min(0.0)
        return active + (torch.linalg.vector_norm(forces.shear, dim=1) > threshold)

    def passed_through(self, u: torch.Tensor, pose: Pose, conditions: Conditions) -> torch.Tensor:
        """Return whether a point of the face is above the shape, shape (b,), bool; ``u``: (n, 3, b)."""
        above = torch.zeros(u.shape[2], dtype=torch.int32, device=u.device)
        members = kernel_data.member_data(conditions, pose)
        for distance, chosen in self.by_shape(conditions):
            wp.launch(
                passage_kernel(distance),
                dim=(len(self.faces), len(chosen)),
                inputs=[argument(u), self.data, members, argument(chosen)],
                outputs=[argument(above)],
                device=self.device,
            )
        return above > 0

    def _mean_place(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return the mean place under every hat [mm], shape (s, 3, b)."""
        return self.mortar.means(u) + self._mean_nodes + self._mean_rise * (conditions.thickness - 1)

    def _gaps(
        self,
        u: torch.Tensor,
        place: torch.Tensor,
        pose: Pose,
        members: Any,
        pressed: list[tuple[wp.Function, torch.Tensor]],
    ) -> torch.Tensor:
        """Return mean gaps [mm], shape (s, b); above a plane they are those of the mean places."""
        if self.flat:
            # The third column of the rotation is the plane's normal.
            return torch.einsum("ib,sib->sb", pose.turn[:, 2], place - pose.place)
        gap = self._zeros(u)
        for distance, chosen in pressed:
            wp.launch(
                kernels.gap_kernel(distance),
                dim=(len(self.faces), len(chosen)),
                inputs=[argument(u), self.data, members, argument(chosen)],
                outputs=[argument(gap)],
                device=self.device,
            )
        return gap

    def _zeros(self, sample: torch.Tensor, *shape: int) -> torch.Tensor:
        """Return zeros for every contact node of as many members as ``sample`` has."""
        return torch.zeros(self.count, *shape, sample.shape[-1], dtype=torch.float64, device=sample.device)


def face_quadrature(nodes: torch.Tensor, faces: torch.Tensor, subdivisions: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return area weights [mm^2], shape (f, k), and shape functions (k, 6) of quadratic triangles."""
    points, weights = elements.triangle_quadrature(subdivisions)
    slopes = torch.as_tensor(elements.triangle_gradients(points), device=nodes.device)
    tangents = torch.einsum("fai,kaj->fkij", nodes[faces.long()], slopes)
    area = torch.linalg.norm(torch.cross(tangents[..., 0], tangents[..., 1], dim=-1), dim=-1)
    shapes = torch.as_tensor(elements.triangle_shapes(points), device=nodes.device)
    return (area * torch.as_tensor(weights, device=nodes.device)).contiguous(), shapes.contiguous()
