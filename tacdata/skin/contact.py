# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Contact of a face of the skin with a rigid shape: augmented Lagrangian, integrated over the faces, Coulomb friction.

At every quadrature point the normal traction is t = max(0, lambda - penalty * gap) (Alart and Curnier 1991; Simo and
Laursen 1992). Friction is a return mapping of the tangential traction onto the disc of radius mu t, with history kept
from the last converged state. Far from the solution friction enters the stiffness by its secant (Kacanov's method): a
majorant of the dissipation, so that iterates do not flip between opposite slips as they do with the tangent; near it by
the tangent, without the derivative of the disc's radius, so that the stiffness stays symmetric.
Tractions are per undeformed area.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import torch
import warp as wp

from tacdata.skin import elements
from tacdata.skin.elasticity import vectors

Parameters = wp.types.vector(length=8, dtype=wp.float64)


@wp.func
def board_distance(p: wp.vec3d, q: Parameters):
    """Signed distance from a half-space below z = 0."""
    return p[2]


@cache
def _kernels(distance) -> SimpleNamespace:
    """Compile the contact kernels of one shape."""

    @wp.func
    def to_shape(x: wp.vec3d, pose: wp.vec4d):
        # pose: tip position and yaw; into the shape's own frame
        c, s = wp.cos(pose[3]), wp.sin(pose[3])
        d = x - wp.vec3d(pose[0], pose[1], pose[2])
        return wp.vec3d(c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2])

    @wp.func
    def to_sensor(n: wp.vec3d, pose: wp.vec4d):
        c, s = wp.cos(pose[3]), wp.sin(pose[3])
        return wp.vec3d(c * n[0] - s * n[1], s * n[0] + c * n[1], n[2])

    @wp.kernel(module="unique")
    def traction(
        u: wp.array2d(dtype=wp.vec3d), nodes: wp.array(dtype=wp.vec3d), faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=wp.float64), weights: wp.array2d(dtype=wp.float64),
        pose: wp.array(dtype=wp.vec4d), q: Parameters, penalty: wp.float64, stick: wp.float64, friction: wp.float64,
        sharp: wp.float64,
        multiplier: wp.array3d(dtype=wp.float64), anchor: wp.array3d(dtype=wp.vec3d), held: wp.array3d(dtype=wp.vec3d),
        gap_before: wp.array3d(dtype=wp.float64), pose_before: wp.array(dtype=wp.vec4d),
        force: wp.array2d(dtype=wp.vec3d), gap: wp.array3d(dtype=wp.float64),
        pressure: wp.array3d(dtype=wp.float64), shear: wp.array3d(dtype=wp.vec3d),
        place: wp.array3d(dtype=wp.vec3d), stiffness: wp.array3d(dtype=wp.mat33d),
    ):
        b, f, k = wp.tid()
        zero, one = wp.float64(0.0), wp.float64(1.0)
        x = wp.vec3d()
        for a in range(6):
            n = faces[f, a]
            x += shapes[k, a] * (nodes[n] + u[b, n])
        local = to_shape(x, pose[b])
        g = distance(local, q)
        relative = x - wp.vec3d(pose[b][0], pose[b][1], pose[b][2])
        gap[b, f, k] = g
        place[b, f, k] = relative
        t = multiplier[b, f, k] - penalty * g
        pressure[b, f, k] = zero
        shear[b, f, k] = wp.vec3d()
        stiffness[b, f, k] = wp.mat33d()
        if t > zero:
            h = wp.float64(1.0e-6)
            normal = wp.vec3d(
                distance(local + wp.vec3d(h, zero, zero), q) - distance(local - wp.vec3d(h, zero, zero), q),
                distance(local + wp.vec3d(zero, h, zero), q) - distance(local - wp.vec3d(zero, h, zero), q),
                distance(local + wp.vec3d(zero, zero, h), q) - distance(local - wp.vec3d(zero, zero, h), q),
            )
            normal = to_sensor(wp.normalize(normal), pose[b])
            nn = wp.outer(normal, normal)
            tangential = wp.identity(n=3, dtype=wp.float64) - nn
            pressure[b, f, k] = t
            D = penalty * nn
            total = t * normal
            if friction > zero:
                # A point that was open slips only from the moment at which the shape, moving straight, reached it.
                moved = wp.vec3d(pose[b][0], pose[b][1], pose[b][2]) - wp.vec3d(
                    pose_before[b][0], pose_before[b][1], pose_before[b][2]
                )
                after = one
                approach = wp.dot(moved, normal)
                if gap_before[b, f, k] > zero:
                    after = zero
                    if approach > gap_before[b, f, k]:
                        after = one - gap_before[b, f, k] / approach
                trial = tangential * (held[b, f, k] - (stick * after) * (relative - anchor[b, f, k]))
                size = wp.length(trial)
                limit = friction * t
                scale = one
                along = wp.mat33d()
                if size > limit:
                    scale = limit / size
                    along = (sharp / (size * size)) * wp.outer(trial, trial)
                D += (stick * after * scale) * (tangential - along)
                trial = scale * trial
                shear[b, f, k] = trial
                total += trial
            stiffness[b, f, k] = D
            for a in range(6):
                wp.atomic_add(force, b, faces[f, a], (shapes[k, a] * weights[f, k]) * total)

    @wp.kernel(module="unique")
    def product(
        p: wp.array2d(dtype=wp.vec3d), faces: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=wp.float64),
        weights: wp.array2d(dtype=wp.float64), pressure: wp.array3d(dtype=wp.float64),
        stiffness: wp.array3d(dtype=wp.mat33d), result: wp.array2d(dtype=wp.vec3d),
    ):
        b, f, k = wp.tid()
        if pressure[b, f, k] > wp.float64(0.0):
            v = wp.vec3d()
            for a in range(6):
                v += shapes[k, a] * p[b, faces[f, a]]
            r = stiffness[b, f, k] * v
            for a in range(6):
                wp.atomic_add(result, b, faces[f, a], (shapes[k, a] * weights[f, k]) * r)

    return SimpleNamespace(traction=traction, product=product)


@dataclass
class ContactState:
    """What a contact carries from one state to the next; every array has shape (b, faces, points)."""

    multiplier: torch.Tensor
    """Normal traction of the augmented Lagrangian [MPa], shape (b, f, k)."""
    anchor: torch.Tensor
    """Place of each point relative to the shape at the last converged state [mm], shape (b, f, k, 3)."""
    held: torch.Tensor
    """Tangential traction at the last converged state [MPa], shape (b, f, k, 3)."""
    gap: torch.Tensor
    """Gap at the last converged state [mm], shape (b, f, k)."""
    pose: torch.Tensor
    """Pose of the shape at the last converged state [mm, rad], shape (b, 4)."""


class Contact:
    """A set of faces against one rigid shape."""

    def __init__(
        self, mesh_nodes: torch.Tensor, faces: torch.Tensor, area_weights: torch.Tensor, shapes: torch.Tensor,
        distance: wp.Function, parameters: tuple[float, ...], friction: float, penalty: float, stick: float,
    ) -> None:
        """Bind faces (f, 6), quadrature (weights (f, k) [mm^2], shapes (k, 6)) and the shape's distance function."""
        self.device = str(mesh_nodes.device)
        self.faces, self.weights, self.shapes, self.nodes = faces, area_weights, shapes, mesh_nodes
        self.friction, self.penalty, self.stick = friction, penalty, stick
        self.sharp = 0.0
        """0 for the secant of friction, 1 for its tangent."""
        self._q = Parameters(*parameters, *([0.0] * (8 - len(parameters))))
        self._kernels = _kernels(distance)
        self._faces, self._shapes = wp.from_torch(faces), wp.from_torch(shapes)
        self._weights = wp.from_torch(area_weights)
        self._nodes = wp.from_torch(mesh_nodes, dtype=wp.vec3d)
        self.pressure = self.gap = self.shear = self.place = self.stiffness = torch.empty(0)

    def start(self, pose: torch.Tensor) -> ContactState:
        """Return the state without contact, the shape at ``pose`` (b, 4)."""
        f, k = self.weights.shape
        batch = len(pose)
        scalars = torch.zeros(batch, f, k, dtype=torch.float64, device=self.nodes.device)
        triples = torch.zeros(batch, f, k, 3, dtype=torch.float64, device=self.nodes.device)
        self.gap, self.pressure = scalars.clone(), scalars.clone()
        self.shear, self.place = triples.clone(), triples.clone()
        self.stiffness = torch.zeros(batch, f, k, 3, 3, dtype=torch.float64, device=self.nodes.device)
        infinite = torch.full_like(scalars, torch.inf)
        return ContactState(scalars.clone(), triples.clone(), triples.clone(), infinite, pose.clone())

    def add_force(self, u: torch.Tensor, pose: torch.Tensor, state: ContactState, force: torch.Tensor) -> None:
        """Add the contact's nodal forces on the skin [N] to ``force`` (b, n, 3); keeps gap, tractions and stiffness.

        Args:
            u: Displacements [mm], shape (b, n, 3).
            pose: Tip x, y, z [mm] and yaw [rad] of the shape, shape (b, 4).
            state: History.
            force: Receives the forces.
        """
        f, k = self.weights.shape
        wp.launch(
            self._kernels.traction, dim=(u.shape[0], f, k),
            inputs=[
                vectors(u), self._nodes, self._faces, self._shapes, self._weights, wp.from_torch(pose, dtype=wp.vec4d),
                self._q, self.penalty, self.stick, self.friction, self.sharp, wp.from_torch(state.multiplier),
                wp.from_torch(state.anchor, dtype=wp.vec3d), wp.from_torch(state.held, dtype=wp.vec3d),
                wp.from_torch(state.gap), wp.from_torch(state.pose, dtype=wp.vec4d),
            ],
            outputs=[
                vectors(force), wp.from_torch(self.gap), wp.from_torch(self.pressure),
                wp.from_torch(self.shear, dtype=wp.vec3d), wp.from_torch(self.place, dtype=wp.vec3d),
                wp.from_torch(self.stiffness, dtype=wp.mat33d),
            ],
            device=self.device,
        )

    def add_product(self, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the contact stiffness times ``p`` [N] to ``result``; both of shape (b, n, 3)."""
        f, k = self.weights.shape
        wp.launch(
            self._kernels.product, dim=(p.shape[0], f, k),
            inputs=[
                vectors(p), self._faces, self._shapes, self._weights, wp.from_torch(self.pressure),
                wp.from_torch(self.stiffness, dtype=wp.mat33d),
            ],
            outputs=[vectors(result)], device=self.device,
        )

    def face_stiffness(self, which: torch.Tensor) -> torch.Tensor:
        """Return the stiffness of some faces' nodes at the state last evaluated [N/mm], shape (len(which), 18, 18)."""
        weighted = self.stiffness[0, which] * self.weights[which][:, :, None, None]
        return torch.einsum("ka,fkij,kb->faibj", self.shapes, weighted, self.shapes).reshape(-1, 18, 18)

    def augment(self, state: ContactState) -> None:
        """Take the present normal tractions as multipliers (Uzawa step)."""
        state.multiplier.copy_(self.pressure)

    def accept(self, state: ContactState, pose: torch.Tensor) -> None:
        """Make the present state, with the shape at ``pose``, the history that friction starts from."""
        state.anchor.copy_(self.place)
        state.held.copy_(self.shear)
        state.gap.copy_(torch.where(self.pressure > 0, torch.zeros_like(self.gap), self.gap))
        state.pose.copy_(pose)

    def misfit(self) -> torch.Tensor:
        """Return the largest |gap| among points that carry load [mm], shape (b,): penetration, or load across a gap."""
        return torch.where(self.pressure > 0, self.gap.abs(), torch.zeros_like(self.gap)).flatten(1).amax(dim=1)


def face_quadrature(nodes: torch.Tensor, faces: torch.Tensor, subdivisions: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return area weights [mm^2], shape (f, k), and shape functions (k, 6) of quadratic triangles."""
    points, weights = elements.triangle_quadrature(subdivisions)
    slopes = torch.as_tensor(elements.triangle_gradients(points), device=nodes.device)
    tangents = torch.einsum("fai,kaj->fkij", nodes[faces.long()], slopes)
    area = torch.linalg.norm(torch.cross(tangents[..., 0], tangents[..., 1], dim=-1), dim=-1)
    shapes = torch.as_tensor(elements.triangle_shapes(points), device=nodes.device)
    return (area * torch.as_tensor(weights, device=nodes.device)).contiguous(), shapes.contiguous()
