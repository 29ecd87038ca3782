"""Contact of faces of the skin with a rigid shape: augmented Lagrangian, integrated over the faces, Coulomb friction.

At every quadrature point the normal traction is t = max(0, lambda - penalty * gap) (Alart and Curnier 1991; Simo and
Laursen 1992). Friction is a return mapping of the shear traction onto the disc of radius mu t. Its history is that of
the last equilibrium. Far from the solution friction enters the stiffness by its secant (Kacanov's method). That is a
majorant of the dissipation, so that iterates do not flip between opposite slips as they do with the tangent. Near the
solution it enters by the tangent, without the derivative of the disc's radius: so the stiffness stays symmetric.
Tractions are per undeformed area. Arrays of points are laid out (faces, points, ..., batch).
"""

from __future__ import annotations

import torch
import warp as wp

from tacdata.skin.contact import kernels
from tacdata.skin.contact.contact_forces import ContactForces, ContactTangent
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.skin.mesh import elements


class ContactSurface:
    """Faces of the mesh against one rigid shape. It holds nothing that changes while presses are solved."""

    def __init__(
        self, nodes: torch.Tensor, faces: torch.Tensor, subdivisions: int, distance: wp.Function, rough: bool,
        penalty: float, stick: float,
    ) -> None:
        """Bind faces of the mesh and a shape.

        Args:
            nodes: Undeformed positions [mm], shape (n, 3).
            faces: Quadratic triangles, shape (f, 6), int32.
            subdivisions: The quadrature rule is repeated on the square of this many sub-triangles.
            distance: Signed distance of the shape (`tacdata.indenters.indenter`).
            rough: Whether there is friction (its coefficient is each member's own).
            penalty: Normal stiffness over Young's modulus [1/mm].
            stick: Tangential stiffness of sticking points over Young's modulus [1/mm].
        """
        self.faces, self.distance, self.device = faces, distance, str(nodes.device)
        self.weights, self.shapes = face_quadrature(nodes, faces, subdivisions)
        self.data = filled(
            kernels.SurfaceData, nodes=nodes, faces=faces, shapes=self.shapes, weights=self.weights, penalty=penalty,
            stick=stick, rough=int(rough),
        )
        """The same, as kernels take it."""
        self.rule = {
            dtype: (self.shapes.to(dtype).contiguous(), self.weights.to(dtype).contiguous()) for dtype in REAL
        }
        """Shape functions, shape (k, 6), and weights [mm^2], shape (f, k), by precision."""

    def start(self, pose: Pose) -> ContactHistory:
        """Return the history of members without contact, the shape at ``pose``."""
        place = pose.place.clone()
        multiplier, gap = self._values(place), torch.full_like(self._values(place), torch.inf)
        return ContactHistory(multiplier, self._values(place, 3), self._values(place, 3), gap, place)

    def add_forces(
        self, u: torch.Tensor, pose: Pose, history: ContactHistory, conditions: Conditions,
        friction_tangent: torch.Tensor, total: torch.Tensor,
    ) -> ContactForces:
        """Add the contact's nodal forces on the skin [N] to ``total``, shape (n, 3, b).

        Args:
            u: Displacements [mm], shape (n, 3, b), float64.
            pose: Of the shape.
            history: Where friction starts from, and the multipliers.
            conditions: Friction, thickness, modulus and the shape's parameters.
            friction_tangent: Stiffness of slipping points: 0 by the secant of friction, 1 by its tangent, shape (b,).
            total: Receives the forces.

        Returns:
            Tractions, their stiffness, and the resultant.
        """
        nodal, gap, pressure = torch.zeros_like(total), self._values(u), self._values(u)
        shear, local, stiffness = self._values(u, 3), self._values(u, 3), self._values(u, 6)
        found = filled(kernels.PointData, gap=gap, pressure=pressure, shear=shear, local=local)
        wp.launch(
            kernels.traction_kernel(self.distance), dim=(*self.weights.shape, u.shape[2]),
            inputs=[
                argument(u), self.data, kernels.member_data(conditions, pose), kernels.history_data(history),
                argument(friction_tangent),
            ],
            outputs=[argument(nodal), found, argument(stiffness)], device=self.device,
        )
        total += nodal
        tangent = ContactTangent(pressure, stiffness, (pressure > 0).any(dim=1))
        return ContactForces(nodal.sum(dim=0), gap, pressure, shear, local, tangent)

    def add_product(self, at: ContactTangent, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the contact stiffness times ``p`` [N] to ``result``; both of shape (n, 3, b) and of one precision."""
        shapes, weights = self.rule[p.dtype]
        inputs = [p, self.faces, shapes, weights, weights.shape[1], at.pressure, at.stiffness, at.touched]
        wp.launch(
            kernels.product_kernel(REAL[p.dtype]), dim=(len(self.faces), p.shape[2]),
            inputs=[argument(value) for value in inputs], outputs=[argument(result)], device=self.device,
        )

    def face_stiffness(self, at: ContactTangent, face: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return the nodal stiffness of some faces [N/mm], shape (pairs, 18, 18), float32.

        Args:
            at: The stiffness of all points.
            face: Index of the face, shape (pairs,).
            member: Index of the batch member, shape (pairs,).
        """
        packed = self._weighted(at, face, member, 6)
        shapes = self.shapes.to(torch.float32)
        pairs = torch.einsum("ka,kb->abk", shapes, shapes).reshape(36, -1)
        six = torch.einsum("nk,pkc->pnc", pairs, packed)
        full = six[:, :, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 6, 6, 3, 3)
        return full.permute(0, 1, 3, 2, 4).reshape(-1, 18, 18)

    def face_diagonal(self, at: ContactTangent, face: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return the diagonals of `face_stiffness` [N/mm], shape (pairs, 18)."""
        packed = self._weighted(at, face, member, 3)
        return torch.einsum("ka,pkc->pac", self.shapes.to(torch.float32).square(), packed).reshape(-1, 18)

    def weighted_stiffness(self, at: ContactTangent) -> torch.Tensor:
        """Return the stiffness of every point that carries load [N/mm], shape (f, k, 6, b), float32."""
        loaded = (at.pressure > 0)[:, :, None]
        weights = self.rule[torch.float32][1]
        return torch.where(loaded, at.stiffness, 0.0).to(torch.float32) * weights[..., None, None]

    def penetration(self, now: ContactForces) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the largest |gap| among points that carry load, and its mean weighted by their load [mm].

        Both of shape (b,): penetration, or load across a gap. The mean is what the force is off by; the largest is that
        of some point at the contact's edge.
        """
        carried = torch.where(now.pressure > 0, now.gap.abs(), torch.zeros_like(now.gap))
        load = now.pressure * self.weights[:, :, None]
        mean = (load * carried).sum(dim=(0, 1)) / load.sum(dim=(0, 1)).clamp_min(1e-30)
        return carried.flatten(0, 1).amax(dim=0), mean

    def _values(self, like: torch.Tensor, *shape: int) -> torch.Tensor:
        """Return zeros for every point of as many members as ``like`` has."""
        return torch.zeros(*self.weights.shape, *shape, like.shape[-1], dtype=torch.float64, device=like.device)

    def _weighted(self, at: ContactTangent, face: torch.Tensor, member: torch.Tensor, count: int) -> torch.Tensor:
        """Return the first entries of the stiffness of some faces' points [N/mm], shape (pairs, k, count), float32."""
        packed = at.stiffness[face, :, :count, member] * self.weights[face][:, :, None]
        return torch.where((at.pressure[face, :, member] > 0)[..., None], packed, 0.0).to(torch.float32)


def face_quadrature(nodes: torch.Tensor, faces: torch.Tensor, subdivisions: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return area weights [mm^2], shape (f, k), and shape functions (k, 6) of quadratic triangles."""
    points, weights = elements.triangle_quadrature(subdivisions)
    slopes = torch.as_tensor(elements.triangle_gradients(points), device=nodes.device)
    tangents = torch.einsum("fai,kaj->fkij", nodes[faces.long()], slopes)
    area = torch.linalg.norm(torch.cross(tangents[..., 0], tangents[..., 1], dim=-1), dim=-1)
    shapes = torch.as_tensor(elements.triangle_shapes(points), device=nodes.device)
    return (area * torch.as_tensor(weights, device=nodes.device)).contiguous(), shapes.contiguous()
