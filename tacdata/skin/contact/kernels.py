# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false, reportInvalidTypeForm=false
"""Warp kernels of `tacdata.skin.contact.contact_surface`: tractions at quadrature points, and their stiffness.

Indices: f a face, k a point of its quadrature rule, b a batch member.
"""

from functools import cache

import warp as wp

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import filled

Parameters = wp.types.vector(length=8, dtype=wp.float64)
"""Numbers of an indenter's distance function."""


@wp.struct
class SurfaceData:
    """What never changes: faces of the mesh, their quadrature rule, and the contact's stiffnesses."""

    nodes: wp.array2d(dtype=wp.float64)
    faces: wp.array2d(dtype=wp.int32)
    shapes: wp.array2d(dtype=wp.float64)
    weights: wp.array2d(dtype=wp.float64)
    penalty: wp.float64
    stick: wp.float64
    rough: int


@wp.struct
class MemberData:
    """Conditions and pose of the batch members (or their changes)."""

    thickness: wp.array(dtype=wp.float64)
    modulus: wp.array(dtype=wp.float64)
    friction: wp.array(dtype=wp.float64)
    indenter: wp.array2d(dtype=wp.float64)
    place: wp.array2d(dtype=wp.float64)
    turn: wp.array3d(dtype=wp.float64)


@wp.struct
class HistoryData:
    """`ContactHistory` (or its change)."""

    multiplier: wp.array3d(dtype=wp.float64)
    anchor: wp.array4d(dtype=wp.float64)
    held: wp.array4d(dtype=wp.float64)
    gap: wp.array3d(dtype=wp.float64)
    place: wp.array2d(dtype=wp.float64)


@wp.struct
class PointData:
    """What is found at each point: gap, tractions, place in the shape's frame (or their changes)."""

    gap: wp.array3d(dtype=wp.float64)
    pressure: wp.array3d(dtype=wp.float64)
    shear: wp.array4d(dtype=wp.float64)
    local: wp.array4d(dtype=wp.float64)


def member_data(conditions: Conditions, pose: Pose) -> MemberData:
    """Return conditions and pose as a kernel takes them; all tensors contiguous."""
    return filled(
        MemberData, thickness=conditions.thickness, modulus=conditions.modulus, friction=conditions.friction,
        indenter=conditions.indenter, place=pose.place, turn=pose.turn,
    )


def history_data(history: ContactHistory) -> HistoryData:
    """Return a history as a kernel takes it; all tensors contiguous."""
    return filled(
        HistoryData, multiplier=history.multiplier, anchor=history.anchor, held=history.held, gap=history.gap,
        place=history.place,
    )


def point_data(found: ContactForces) -> PointData:
    """Return where a kernel writes what it finds at each point."""
    return filled(PointData, gap=found.gap, pressure=found.pressure, shear=found.shear, local=found.local)


@wp.func
def board_distance(p: wp.vec3d, q: Parameters):
    """Signed distance from a half-space below z = 0."""
    return p[2]


@wp.func
def at_point(values: wp.array4d(dtype=wp.float64), f: int, k: int, b: int):
    """Return a vector of a point."""
    return wp.vec3d(values[f, k, 0, b], values[f, k, 1, b], values[f, k, 2, b])


@wp.func
def of_member(values: wp.array2d(dtype=wp.float64), b: int):
    """Return a vector of a member."""
    return wp.vec3d(values[0, b], values[1, b], values[2, b])


@wp.func
def parameters_of(values: wp.array2d(dtype=wp.float64), b: int):
    """Return the numbers of a member's shape."""
    q = Parameters()
    for i in range(8):
        q[i] = values[i, b]
    return q


@wp.func
def rotation_of(turn: wp.array3d(dtype=wp.float64), b: int):
    """Return the rotation from a member's shape to the sensor's frame."""
    return wp.mat33d(
        turn[0, 0, b], turn[0, 1, b], turn[0, 2, b], turn[1, 0, b], turn[1, 1, b], turn[1, 2, b],
        turn[2, 0, b], turn[2, 1, b], turn[2, 2, b],
    )


@wp.func
def deformed_point(
    u: wp.array3d(dtype=wp.float64), surface: SurfaceData, f: int, k: int, b: int, thickness: wp.float64
):
    """Return the place of a point of the deformed face [mm]; heights of the slab are scaled by ``thickness``."""
    x = wp.vec3d()
    for a in range(6):
        n = surface.faces[f, a]
        z = surface.nodes[n, 2]
        if z > wp.float64(0.0):
            z = z * thickness
        x += surface.shapes[k, a] * wp.vec3d(
            surface.nodes[n, 0] + u[n, 0, b], surface.nodes[n, 1] + u[n, 1, b], z + u[n, 2, b]
        )
    return x


@wp.func
def friction_cone_projection(trial: wp.vec3d, limit: wp.float64, tangent: wp.float64):
    """Map a trial shear traction back onto the disc of radius ``limit``.

    Returns:
        The factor by which it is shortened, and the matrix that the stiffness of a slipping point lacks beside its
        secant: that of the direction of slip, times ``tangent`` (0 for the secant, 1 for the tangent).
    """
    scale = wp.float64(1.0)
    along = wp.mat33d()
    size = wp.length(trial)
    if size > limit:
        scale = limit / size
        along = (tangent / (size * size)) * wp.outer(trial, trial)
    return scale, along


@wp.func
def share_in_contact(gap_before: wp.float64, approach: wp.float64):
    """Return which share of a step [1] a point is in contact for, if the shape approaches it at a steady speed.

    A point that was closed is so all the time. One that was open slips only from the moment at which it is reached.
    """
    share = wp.float64(1.0)
    if gap_before > wp.float64(0.0):
        share = wp.float64(0.0)
        if approach > gap_before:
            share = wp.float64(1.0) - gap_before / approach
    return share


@cache
def normal_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, q)``: the outward unit normal of a shape near a place in its frame, by central differences."""

    @wp.func
    def normal(p: wp.vec3d, q: Parameters):
        h, zero = wp.float64(1.0e-6), wp.float64(0.0)  # mm
        return wp.normalize(wp.vec3d(
            distance(p + wp.vec3d(h, zero, zero), q) - distance(p - wp.vec3d(h, zero, zero), q),
            distance(p + wp.vec3d(zero, h, zero), q) - distance(p - wp.vec3d(zero, h, zero), q),
            distance(p + wp.vec3d(zero, zero, h), q) - distance(p - wp.vec3d(zero, zero, h), q),
        ))

    return normal


@cache
def traction_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel of forces for one shape; in double precision, as gaps are differences of large numbers."""
    normal = normal_function(distance)

    @wp.kernel(module="unique", enable_backward=False)
    def traction(
        u: wp.array3d(dtype=wp.float64), surface: SurfaceData, members: MemberData, history: HistoryData,
        friction_tangent: wp.array(dtype=wp.float64), force: wp.array3d(dtype=wp.float64), found: PointData,
        stiffness: wp.array4d(dtype=wp.float64),
    ):
        """Tractions of one point, added to the nodes.

        1. Place of the point in the shape's frame, and its gap.
        2. Normal traction: multiplier less penalty times gap, not below zero.
        3. Trial shear: what was held, less the stiffness of sticking times the slip since.
        4. Return mapping of the trial onto Coulomb's disc.
        5. Stiffness of the point, symmetric: xx, yy, zz, xy, yz, xz in the sensor's frame.
        6. Forces on the face's nodes.
        """
        f, k, b = wp.tid()
        zero = wp.float64(0.0)
        q = parameters_of(members.indenter, b)
        R = rotation_of(members.turn, b)
        tip = of_member(members.place, b)
        local = wp.transpose(R) * (deformed_point(u, surface, f, k, b, members.thickness[b]) - tip)
        g = distance(local, q)
        penalty, stick = surface.penalty * members.modulus[b], surface.stick * members.modulus[b]
        t = history.multiplier[f, k, b] - penalty * g
        found.gap[f, k, b] = g
        found.pressure[f, k, b] = wp.max(t, zero)
        for i in range(3):
            found.local[f, k, i, b] = local[i]
            found.shear[f, k, i, b] = zero
        if t > zero:
            n = normal(local, q)
            nn = wp.outer(n, n)
            D = penalty * nn
            total = t * n
            coefficient = members.friction[b]
            if surface.rough == 1 and coefficient > zero:
                tangential = wp.identity(n=3, dtype=wp.float64) - nn
                moved = wp.transpose(R) * (tip - of_member(history.place, b))
                after = share_in_contact(history.gap[f, k, b], wp.dot(moved, n))
                slid = local - at_point(history.anchor, f, k, b)
                trial = tangential * (at_point(history.held, f, k, b) - (stick * after) * slid)
                scale, along = friction_cone_projection(trial, coefficient * t, friction_tangent[b])
                D += (stick * after * scale) * (tangential - along)
                trial = scale * trial
                for i in range(3):
                    found.shear[f, k, i, b] = trial[i]
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
                    wp.atomic_add(
                        force, surface.faces[f, a], i, b, surface.shapes[k, a] * surface.weights[f, k] * total[i]
                    )

    return traction


@cache
def product_kernel(real: type) -> wp.Kernel:
    """Compile the kernel that applies the contact stiffness, in one precision."""
    vec3, Nodal = wp.types.vector(3, real), wp.types.matrix((6, 3), real)

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        p: wp.array3d(dtype=real), faces: wp.array2d(dtype=wp.int32), shapes: wp.array2d(dtype=real),
        weights: wp.array2d(dtype=real), points: int, pressure: wp.array3d(dtype=wp.float64),
        stiffness: wp.array4d(dtype=wp.float64), touched: wp.array2d(dtype=wp.bool), result: wp.array3d(dtype=real),
    ):
        """Stiffness of the points that carry load times nodal displacements ``p``, added to the nodes; one face."""
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
