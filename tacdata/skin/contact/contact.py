# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Contact of a face of the skin with a rigid shape: augmented Lagrangian, integrated over the faces, Coulomb friction.

At every quadrature point the normal traction is t = max(0, lambda - penalty * gap) (Alart and Curnier 1991; Simo and
Laursen 1992). Friction is a return mapping of the tangential traction onto the disc of radius mu t, with history kept
from the last converged state. Far from the solution friction enters the stiffness by its secant (Kacanov's method): a
majorant of the dissipation, so that iterates do not flip between opposite slips as they do with the tangent; near it by
the tangent, without the derivative of the disc's radius, so that the stiffness stays symmetric.
Tractions are per undeformed area. Arrays of points are laid out (faces, points, ..., batch).
"""

from copy import copy
from dataclasses import dataclass, fields
from functools import cache

import torch
import warp as wp

from tacdata.skin.elasticity.body import REAL
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import handed
from tacdata.skin.mesh import elements

Parameters = wp.types.vector(length=8, dtype=wp.float64)


@wp.func
def board_distance(p: wp.vec3d, q: Parameters):
    """Signed distance from a half-space below z = 0."""
    return p[2]


@cache
def _traction(distance):
    """Compile the kernel of forces for one shape; in double precision, as gaps are differences of large numbers."""

    @wp.func
    def point(
        u: wp.array3d(dtype=wp.float64), nodes: wp.array2d(dtype=wp.float64), faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=wp.float64), f: int, k: int, b: int, thickness: wp.float64,
    ):
        x = wp.vec3d()
        for a in range(6):
            n = faces[f, a]
            z = nodes[n, 2]
            if z > wp.float64(0.0):
                z = z * thickness
            x += shapes[k, a] * wp.vec3d(nodes[n, 0] + u[n, 0, b], nodes[n, 1] + u[n, 1, b], z + u[n, 2, b])
        return x

    @wp.func
    def read(values: wp.array4d(dtype=wp.float64), f: int, k: int, b: int):
        return wp.vec3d(values[f, k, 0, b], values[f, k, 1, b], values[f, k, 2, b])

    @wp.kernel(module="unique", enable_backward=False)
    def traction(
        u: wp.array3d(dtype=wp.float64), nodes: wp.array2d(dtype=wp.float64), faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=wp.float64), weights: wp.array2d(dtype=wp.float64),
        thickness: wp.array(dtype=wp.float64), modulus: wp.array(dtype=wp.float64),
        coefficient: wp.array(dtype=wp.float64), parameters: wp.array2d(dtype=wp.float64),
        place: wp.array2d(dtype=wp.float64), turn: wp.array3d(dtype=wp.float64),
        penalty_over_modulus: wp.float64, stick_over_modulus: wp.float64, rough: int, sharp: wp.array(dtype=wp.float64),
        multiplier: wp.array3d(dtype=wp.float64), anchor: wp.array4d(dtype=wp.float64),
        held: wp.array4d(dtype=wp.float64), gap_before: wp.array3d(dtype=wp.float64),
        place_before: wp.array2d(dtype=wp.float64),
        force: wp.array3d(dtype=wp.float64), gap: wp.array3d(dtype=wp.float64),
        pressure: wp.array3d(dtype=wp.float64), shear: wp.array4d(dtype=wp.float64),
        local_place: wp.array4d(dtype=wp.float64), stiffness: wp.array4d(dtype=wp.float64),
    ):
        f, k, b = wp.tid()
        zero, one = wp.float64(0.0), wp.float64(1.0)
        q = Parameters()
        for i in range(8):
            q[i] = parameters[i, b]
        R = wp.mat33d(
            turn[0, 0, b], turn[0, 1, b], turn[0, 2, b], turn[1, 0, b], turn[1, 1, b], turn[1, 2, b],
            turn[2, 0, b], turn[2, 1, b], turn[2, 2, b],
        )
        tip = wp.vec3d(place[0, b], place[1, b], place[2, b])
        x = point(u, nodes, faces, shapes, f, k, b, thickness[b])
        local = wp.transpose(R) * (x - tip)
        g = distance(local, q)
        penalty, stick = penalty_over_modulus * modulus[b], stick_over_modulus * modulus[b]
        t = multiplier[f, k, b] - penalty * g
        gap[f, k, b] = g
        pressure[f, k, b] = wp.max(t, zero)
        for i in range(3):
            local_place[f, k, i, b] = local[i]
            shear[f, k, i, b] = zero
        if t > zero:
            h = wp.float64(1.0e-6)
            n = wp.normalize(wp.vec3d(
                distance(local + wp.vec3d(h, zero, zero), q) - distance(local - wp.vec3d(h, zero, zero), q),
                distance(local + wp.vec3d(zero, h, zero), q) - distance(local - wp.vec3d(zero, h, zero), q),
                distance(local + wp.vec3d(zero, zero, h), q) - distance(local - wp.vec3d(zero, zero, h), q),
            ))
            nn = wp.outer(n, n)
            D = penalty * nn
            total = t * n
            friction = coefficient[b]
            if rough == 1 and friction > zero:
                tangential = wp.identity(n=3, dtype=wp.float64) - nn
                # A point that was open slips only from the moment at which the shape, moving straight, reached it.
                moved = wp.transpose(R) * (tip - wp.vec3d(place_before[0, b], place_before[1, b], place_before[2, b]))
                after, before = one, gap_before[f, k, b]
                if before > zero:
                    after, approach = zero, wp.dot(moved, n)
                    if approach > before:
                        after = one - before / approach
                trial = tangential * (
                    read(held, f, k, b) - (stick * after) * (local - read(anchor, f, k, b))
                )
                size, limit = wp.length(trial), friction * t
                scale = one
                along = wp.mat33d()
                if size > limit:
                    scale = limit / size
                    along = (sharp[b] / (size * size)) * wp.outer(trial, trial)
                D += (stick * after * scale) * (tangential - along)
                trial = scale * trial
                for i in range(3):
                    shear[f, k, i, b] = trial[i]
                total += trial
            D = R * D * wp.transpose(R)
            total = R * total
            stiffness[f, k, 0, b] = D[0, 0]
            stiffness[f, k, 1, b] = D[1, 1]
            stiffness[f, k, 2, b] = D[2, 2]
            stiffness[f, k, 3, b] = D[0, 1]
            stiffness[f, k, 4, b] = D[1, 2]
            stiffness[f, k, 5, b] = D[0, 2]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(force, faces[f, a], i, b, shapes[k, a] * weights[f, k] * total[i])

    return traction


@cache
def _product(real: type):
    """Compile the kernel that applies the contact stiffness, in one precision."""
    vec3, Nodal = wp.types.vector(3, real), wp.types.matrix((6, 3), real)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        p: wp.array3d(dtype=real), faces: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real), points: int, pressure: wp.array3d(dtype=wp.float64),
        stiffness: wp.array4d(dtype=wp.float64), touched: wp.array2d(dtype=wp.bool), result: wp.array3d(dtype=real),
    ):
        f, b = wp.tid()
        if touched[f, b]:
            along, total = Nodal(), Nodal()
            for a in range(6):
                for i in range(3):
                    along[a, i] = p[faces[f, a], i, b]
            for k in range(points):
                if pressure[f, k, b] > wp.float64(0.0):
                    v = vec3()
                    for a in range(6):
                        v += shapes[k, a] * vec3(along[a, 0], along[a, 1], along[a, 2])
                    xx, yy, zz = (
                        real(stiffness[f, k, 0, b]), real(stiffness[f, k, 1, b]), real(stiffness[f, k, 2, b])
                    )
                    xy, yz, xz = (
                        real(stiffness[f, k, 3, b]), real(stiffness[f, k, 4, b]), real(stiffness[f, k, 5, b])
                    )
                    r = weights[f, k] * vec3(
                        xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2],
                        xz * v[0] + yz * v[1] + zz * v[2],
                    )
                    for a in range(6):
                        for i in range(3):
                            total[a, i] = total[a, i] + shapes[k, a] * r[i]
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(result, faces[f, a], i, b, total[a, i])

    return product


@dataclass
class ContactState:
    """What a contact carries from one state to the next."""

    multiplier: torch.Tensor
    """Normal traction of the augmented Lagrangian [MPa], shape (f, k, b)."""
    anchor: torch.Tensor
    """Place of each point in the shape's frame at the last converged state [mm], shape (f, k, 3, b)."""
    held: torch.Tensor
    """Tangential traction, in the shape's frame, at the last converged state [MPa], shape (f, k, 3, b)."""
    gap: torch.Tensor
    """Gap at the last converged state [mm], shape (f, k, b)."""
    place: torch.Tensor
    """Place of the shape at the last converged state [mm], shape (3, b)."""

    def copy(self) -> "ContactState":
        """Return a copy that shares nothing."""
        return ContactState(*(getattr(self, f.name).clone() for f in fields(self)))

    def take(self, which: torch.Tensor) -> "ContactState":
        """Return some members, by index."""
        return ContactState(*(getattr(self, f.name).index_select(-1, which) for f in fields(self)))

    def set(self, which: torch.Tensor, other: "ContactState") -> None:
        """Take another state's members as those of the columns ``which``."""
        for f in fields(self):
            getattr(self, f.name).index_copy_(-1, which, getattr(other, f.name))

    def put(self, which: torch.Tensor, other: "ContactState") -> None:
        """Take the members marked in ``which``, shape (b,), bool, from another state."""
        for f in fields(self):
            mine = getattr(self, f.name)
            mine.copy_(torch.where(which, getattr(other, f.name), mine))


class Contact:
    """A set of faces against one rigid shape, for every member of a batch."""

    _STIFF: tuple[str, ...] = ("pressure", "stiffness", "touched")
    """What `add_product` reads."""

    _FOUND: tuple[str, ...] = (*_STIFF, "gap", "shear", "local", "force")
    """What `add_force` finds, one column a member."""

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
        self.faces, self.nodes, self.rough = faces, nodes, rough
        self.penalty, self.stick = penalty, stick
        self.weights, self.shapes = face_quadrature(nodes, faces, subdivisions)
        self._traction = _traction(distance)
        self._rule = {
            dtype: (self.shapes.to(dtype).contiguous(), self.weights.to(dtype).contiguous()) for dtype in REAL
        }
        self.pressure = self.gap = self.shear = self.local = self.stiffness = self.touched = torch.empty(0)
        self.force = torch.empty(0)
        """Total on the skin at the state last evaluated [N], shape (3, b)."""
        self.sharp = torch.empty(0)
        """Each member's stiffness of slipping points: 0 the secant of friction, 1 its tangent, shape (b,)."""

    def start(self, pose: Pose) -> ContactState:
        """Return the state without contact, the shape at ``pose``; sizes the contact for the batch."""
        f, k = self.weights.shape
        batch, device = pose.place.shape[1], self.nodes.device

        def zeros(*shape: int) -> torch.Tensor:
            return torch.zeros(f, k, *shape, batch, dtype=torch.float64, device=device)

        self.gap, self.pressure, self.shear, self.local = zeros(), zeros(), zeros(3), zeros(3)
        self.stiffness = zeros(6)
        self.sharp = torch.zeros(batch, dtype=torch.float64, device=device)
        return ContactState(zeros(), zeros(3), zeros(3), torch.full_like(self.gap, torch.inf), pose.place.clone())

    def add_force(
        self, u: torch.Tensor, pose: Pose, state: ContactState, conditions: Conditions, force: torch.Tensor
    ) -> None:
        """Add the contact's nodal forces on the skin [N] to ``force`` (n, 3, b); keeps gap, tractions and stiffness.

        Args:
            u: Displacements [mm], shape (n, 3, b), float64.
            pose: Of the shape.
            state: History.
            conditions: Friction, thickness, modulus and the shape's parameters.
            force: Receives the forces.
        """
        f, k = self.weights.shape
        inputs = [
            u, self.nodes, self.faces, self.shapes, self.weights, conditions.thickness, conditions.modulus,
            conditions.friction, conditions.indenter, pose.place, pose.turn, self.penalty, self.stick, int(self.rough),
            self.sharp, state.multiplier, state.anchor, state.held, state.gap, state.place,
        ]
        nodal = torch.zeros_like(force)
        outputs = [nodal, self.gap, self.pressure, self.shear, self.local, self.stiffness]
        wp.launch(
            self._traction, dim=(f, k, u.shape[2]), inputs=[handed(value) for value in inputs],
            outputs=[handed(value) for value in outputs], device=str(u.device),
        )
        self.touched = (self.pressure > 0).any(dim=1)
        self.force = nodal.sum(dim=0)
        force += nodal

    def add_product(self, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add the contact stiffness times ``p`` [N] to ``result``; both of shape (n, 3, b) and of one precision."""
        shapes, weights = self._rule[p.dtype]
        inputs = [
            p, self.faces, shapes, weights, weights.shape[1], self.pressure, self.stiffness, self.touched,
        ]
        wp.launch(
            _product(REAL[p.dtype]), dim=(len(self.faces), p.shape[2]), inputs=[handed(value) for value in inputs],
            outputs=[handed(result)], device=str(p.device),
        )

    def take(self, which: torch.Tensor) -> "Contact":
        """Return a twin that knows the stiffness of some members alone, by index: for `add_product`."""
        twin = copy(self)
        for name in self._STIFF:
            setattr(twin, name, getattr(self, name).index_select(-1, which))
        return twin

    def retake(self, other: "Contact", which: torch.Tensor) -> None:
        """Do what ``other.take(which)`` does, into the tensors that this twin has."""
        for name in self._STIFF:
            torch.index_select(getattr(other, name), -1, which, out=getattr(self, name))

    def twin(self, pose: Pose, which: torch.Tensor) -> "Contact":
        """Return a contact for some members alone, by index, not evaluated yet; ``pose`` is theirs."""
        twin = copy(self)
        twin.start(pose)
        twin.sharp = self.sharp[which]
        return twin

    def join(self, twin: "Contact", which: torch.Tensor) -> None:
        """Take what a `twin` found for its members."""
        for name in self._FOUND:
            getattr(self, name).index_copy_(-1, which, getattr(twin, name))

    def face_stiffness(self, face: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return nodal stiffness of some faces [N/mm] at the state last evaluated, shape (pairs, 18, 18).

        Args:
            face: Index of the face, shape (pairs,).
            member: Index of the batch's member, shape (pairs,).
        """
        packed = self.stiffness[face, :, :, member] * self.weights[face][:, :, None]
        packed = torch.where((self.pressure[face, :, member] > 0)[..., None], packed, 0.0).to(torch.float32)
        shapes = self.shapes.to(torch.float32)
        pairs = torch.einsum("ka,kb->abk", shapes, shapes).reshape(36, -1)
        six = torch.einsum("nk,pkc->pnc", pairs, packed)
        full = six[:, :, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 6, 6, 3, 3)
        return full.permute(0, 1, 3, 2, 4).reshape(-1, 18, 18)

    def face_diagonal(self, face: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return the diagonals of `face_stiffness` [N/mm], shape (pairs, 18)."""
        packed = self.stiffness[face, :, :3, member] * self.weights[face][:, :, None]
        packed = torch.where((self.pressure[face, :, member] > 0)[..., None], packed, 0.0).to(torch.float32)
        return torch.einsum("ka,pkc->pac", self.shapes.to(torch.float32).square(), packed).reshape(-1, 18)

    def weighted_stiffness(self) -> torch.Tensor:
        """Return the stiffness of every point that carries load [N/mm], shape (f, k, 6, b), float32."""
        loaded = (self.pressure > 0)[:, :, None]
        weights = self._rule[torch.float32][1]
        return torch.where(loaded, self.stiffness, 0.0).to(torch.float32) * weights[..., None, None]

    def augment(self, state: ContactState, which: torch.Tensor) -> None:
        """Take the present normal tractions of the marked members, shape (b,), as multipliers (Uzawa step)."""
        state.multiplier.copy_(torch.where(which, self.pressure, state.multiplier))

    def accept(self, state: ContactState, pose: Pose, which: torch.Tensor) -> None:
        """Make the present state of the marked members, shape (b,), the history that friction starts from.

        Its pressures become the multipliers of the next, so that penetration answers to the increment of load alone.
        """
        now = ContactState(
            self.pressure, self.local, self.shear,
            torch.where(self.pressure > 0, torch.zeros_like(self.gap), self.gap), pose.place,
        )
        state.put(which, now)

    def misfit(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the largest |gap| among points that carry load, and its mean weighted by the load they carry [mm].

        Both of shape (b,): penetration, or load across a gap. The mean is what the force is off by; the largest is that
        of some point at the contact's edge.
        """
        carried = torch.where(self.pressure > 0, self.gap.abs(), torch.zeros_like(self.gap))
        load = self.pressure * self.weights[:, :, None]
        mean = (load * carried).sum(dim=(0, 1)) / load.sum(dim=(0, 1)).clamp_min(1e-30)
        return carried.flatten(0, 1).amax(dim=0), mean


def face_quadrature(nodes: torch.Tensor, faces: torch.Tensor, subdivisions: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return area weights [mm^2], shape (f, k), and shape functions (k, 6) of quadratic triangles."""
    points, weights = elements.triangle_quadrature(subdivisions)
    slopes = torch.as_tensor(elements.triangle_gradients(points), device=nodes.device)
    tangents = torch.einsum("fai,kaj->fkij", nodes[faces.long()], slopes)
    area = torch.linalg.norm(torch.cross(tangents[..., 0], tangents[..., 1], dim=-1), dim=-1)
    shapes = torch.as_tensor(elements.triangle_shapes(points), device=nodes.device)
    return (area * torch.as_tensor(weights, device=nodes.device)).contiguous(), shapes.contiguous()
