"""Warp kernels of `tacdata.skin.contact.contact_surface`: gaps, normal forces, friction.

Indices: f a face, k a point of its quadrature rule, a a node of the face, j a contact node, b a batch member.
"""

from functools import cache

from tacdata.skin.contact.kernel_data import HistoryData, MemberData, Nodal, Parameters, Six, SurfaceData
from tacdata.warp_runtime import wp


@wp.func
def board_distance(p: wp.vec3d, q: Parameters):
    """Signed distance from a half-space below z = 0."""
    return p[2]


@wp.func
def at_node(values: wp.array3d(dtype=wp.float64), j: int, b: int):
    """Return a vector of a node."""
    return wp.vec3d(values[j, 0, b], values[j, 1, b], values[j, 2, b])


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
        turn[0, 0, b],
        turn[0, 1, b],
        turn[0, 2, b],
        turn[1, 0, b],
        turn[1, 1, b],
        turn[1, 2, b],
        turn[2, 0, b],
        turn[2, 1, b],
        turn[2, 2, b],
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
        The factor by which it is shortened, and the matrix that the stiffness of a slipping point lacks, apart from its
        secant: that of the direction of slip, times ``tangent`` (0 for the secant, 1 for the tangent).
    """
    scale = wp.float64(1.0)
    derivative = wp.mat33d()
    size = wp.length(trial)
    if size > limit:
        scale = limit / size
        # The derivative of limit t / |t| by t is scale (I - t t^T / |t|^2); this is its second part.
        derivative = (tangent / (size * size)) * wp.outer(trial, trial)
    return scale, derivative


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
        # The factor 1 / (2 h) of the differences cancels in the normalization.
        return wp.normalize(
            wp.vec3d(
                distance(p + wp.vec3d(h, zero, zero), q) - distance(p - wp.vec3d(h, zero, zero), q),
                distance(p + wp.vec3d(zero, h, zero), q) - distance(p - wp.vec3d(zero, h, zero), q),
                distance(p + wp.vec3d(zero, zero, h), q) - distance(p - wp.vec3d(zero, zero, h), q),
            )
        )

    return normal


@cache
def curvature_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, q)``: how a shape's normal turns with the place [1/mm], symmetric, by central differences."""
    normal = normal_function(distance)

    @wp.func
    def curvature(p: wp.vec3d, q: Parameters):
        # Far above the rounding of the normal (4e-10), far below any radius of curvature.
        h, zero = wp.float64(1.0e-4), wp.float64(0.0)  # mm
        x = (normal(p + wp.vec3d(h, zero, zero), q) - normal(p - wp.vec3d(h, zero, zero), q)) / (wp.float64(2.0) * h)
        y = (normal(p + wp.vec3d(zero, h, zero), q) - normal(p - wp.vec3d(zero, h, zero), q)) / (wp.float64(2.0) * h)
        z = (normal(p + wp.vec3d(zero, zero, h), q) - normal(p - wp.vec3d(zero, zero, h), q)) / (wp.float64(2.0) * h)
        half = wp.float64(0.5)
        # A distance has a symmetric Hessian, and conjugate gradients need one; differences are symmetric only nearly.
        return wp.mat33d(
            x[0],
            half * (x[1] + y[0]),
            half * (x[2] + z[0]),
            half * (x[1] + y[0]),
            y[1],
            half * (y[2] + z[1]),
            half * (x[2] + z[0]),
            half * (y[2] + z[1]),
            z[2],
        )

    return curvature


@cache
def gap_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel of gaps for one shape; in double precision, as gaps are differences of large numbers."""

    @wp.kernel(module="unique", enable_backward=False)
    def gaps(
        u: wp.array3d(dtype=wp.float64),
        surface: SurfaceData,
        members: MemberData,
        pressed_members: wp.array(dtype=wp.int32),
        gap: wp.array2d(dtype=wp.float64),
    ):
        """Add the share of one face to the mean gaps of its nodes, for one of the chosen members."""
        f, c = wp.tid()
        b = pressed_members[c]
        q = parameters_of(members.indenter, b)
        R = rotation_of(members.turn, b)
        tip = of_member(members.place, b)
        total = Six()
        for k in range(surface.weights.shape[1]):
            local = wp.transpose(R) * (deformed_point(u, surface, f, k, b, members.thickness[b]) - tip)
            g = surface.weights[f, k] * distance(local, q)
            for a in range(6):
                total[a] = total[a] + surface.hats[k, a] * g
        for a in range(6):
            j = surface.slots[f, a]
            wp.atomic_add(gap, j, b, total[a] / surface.area[j])

    return gaps


@cache
def pressure_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel of normal forces for one shape."""
    normal, curvature = normal_function(distance), curvature_function(distance)

    @wp.kernel(module="unique", enable_backward=False)
    def pressures(
        u: wp.array3d(dtype=wp.float64),
        surface: SurfaceData,
        members: MemberData,
        pressed_members: wp.array(dtype=wp.int32),
        pressure: wp.array2d(dtype=wp.float64),
        active: wp.array2d(dtype=wp.bool),
        force: wp.array3d(dtype=wp.float64),
        mean_normal: wp.array3d(dtype=wp.float64),
        curved: int,
        turn: wp.array4d(dtype=wp.float32),
    ):
        """Add the normal forces of one face to its nodes, and its share to the mean normals, for a chosen member.

        1. Place of each point in the shape's frame, and the shape's normal there.
        2. Pressure: that of the active nodes, by their hats.
        3. Forces on the face's nodes; the normal's share in the means under the hats.
        4. If the shape is curved, how the force turns with the normal, symmetric: xx, yy, zz, xy, yz, xz.
        """
        f, c = wp.tid()
        b = pressed_members[c]
        some = wp.int32(0)
        values = Six()
        for a in range(6):
            j = surface.slots[f, a]
            values[a] = pressure[j, b]
            if active[j, b]:
                some = 1
        # Most faces are out of contact: end before the distance function is evaluated.
        if some == 0:
            return
        q = parameters_of(members.indenter, b)
        R = rotation_of(members.turn, b)
        tip = of_member(members.place, b)
        total, means = Nodal(), Nodal()
        for k in range(surface.weights.shape[1]):
            local = wp.transpose(R) * (deformed_point(u, surface, f, k, b, members.thickness[b]) - tip)
            n = R * normal(local, q) * surface.weights[f, k]
            p = wp.float64(0.0)
            for a in range(6):
                p += surface.hats[k, a] * values[a]
            if curved == 1 and p > wp.float64(0.0):
                D = (p * surface.weights[f, k]) * (R * curvature(local, q) * wp.transpose(R))
                turn[f, k, 0, b] = wp.float32(D[0, 0])
                turn[f, k, 1, b] = wp.float32(D[1, 1])
                turn[f, k, 2, b] = wp.float32(D[2, 2])
                turn[f, k, 3, b] = wp.float32(D[0, 1])
                turn[f, k, 4, b] = wp.float32(D[1, 2])
                turn[f, k, 5, b] = wp.float32(D[0, 2])
            for a in range(6):
                for i in range(3):
                    total[a, i] = total[a, i] + surface.shapes[k, a] * p * n[i]
                    means[a, i] = means[a, i] + surface.hats[k, a] * n[i]
        for a in range(6):
            j = surface.slots[f, a]
            for i in range(3):
                wp.atomic_add(force, j, i, b, total[a, i])
                wp.atomic_add(mean_normal, j, i, b, means[a, i] / surface.area[j])

    return pressures


@wp.kernel(enable_backward=False)
def friction(
    place: wp.array3d(dtype=wp.float64),
    surface: SurfaceData,
    members: MemberData,
    history: HistoryData,
    pressure: wp.array2d(dtype=wp.float64),
    active: wp.array2d(dtype=wp.bool),
    normals: wp.array3d(dtype=wp.float64),
    friction_tangent: wp.array(dtype=wp.float64),
    local: wp.array3d(dtype=wp.float64),
    shear: wp.array3d(dtype=wp.float64),
    force: wp.array3d(dtype=wp.float64),
    stiffness: wp.array3d(dtype=wp.float64),
):
    """Coulomb friction of one hat.

    1. Mean place of the hat in the shape's frame.
    2. Trial shear: the shear held before, less the stiffness of sticking times the slip since.
    3. Return mapping of the trial onto Coulomb's disc, whose radius is friction times the node's pressure.
    4. Force on the hat, and its stiffness, symmetric: xx, yy, zz, xy, yz, xz in the sensor's frame.
    """
    j, b = wp.tid()
    R = rotation_of(members.turn, b)
    tip = of_member(members.place, b)
    place_now = wp.transpose(R) * (at_node(place, j, b) - tip)
    for i in range(3):
        local[j, i, b] = place_now[i]
    coefficient = members.friction[b]
    if surface.rough == 0 or not active[j, b] or coefficient <= wp.float64(0.0):
        return
    n = wp.transpose(R) * at_node(normals, j, b)
    tangential = wp.identity(n=3, dtype=wp.float64) - wp.outer(n, n)
    step = wp.transpose(R) * (tip - of_member(history.place, b))
    share = share_in_contact(history.gap[j, b], wp.dot(step, n))
    stick = surface.stick * members.modulus[b] * share
    trial = tangential * (at_node(history.held, j, b) - stick * (place_now - at_node(history.anchor, j, b)))
    # An active node may pull until Newton's method has converged; Coulomb's disc has no negative radius.
    scale, projection = friction_cone_projection(
        trial, coefficient * wp.max(pressure[j, b], wp.float64(0.0)), friction_tangent[b]
    )
    D = (surface.area[j] * stick * scale) * (R * (tangential - projection) * wp.transpose(R))
    trial = scale * trial
    total = surface.area[j] * (R * trial)
    for i in range(3):
        shear[j, i, b] = trial[i]
        force[j, i, b] = total[i]
    stiffness[j, 0, b] = D[0, 0]
    stiffness[j, 1, b] = D[1, 1]
    stiffness[j, 2, b] = D[2, 2]
    stiffness[j, 3, b] = D[0, 1]
    stiffness[j, 4, b] = D[1, 2]
    stiffness[j, 5, b] = D[0, 2]


@cache
def slip_kernel(real: type) -> wp.Kernel:
    """Compile the kernel that multiplies slips of hats with friction's stiffness, in one precision."""

    @wp.kernel(module="unique", enable_backward=False)
    def slip(stiffness: wp.array3d(dtype=wp.float64), slips: wp.array3d(dtype=real)):
        """Replace the slip of one hat [mm] by the force against it [N]."""
        j, b = wp.tid()
        # One by one: Warp names bound together refer to the array, and would change with the writes below.
        x = slips[j, 0, b]
        y = slips[j, 1, b]
        z = slips[j, 2, b]
        xx, yy, zz = real(stiffness[j, 0, b]), real(stiffness[j, 1, b]), real(stiffness[j, 2, b])
        xy, yz, xz = real(stiffness[j, 3, b]), real(stiffness[j, 4, b]), real(stiffness[j, 5, b])
        slips[j, 0, b] = xx * x + xy * y + xz * z
        slips[j, 1, b] = xy * x + yy * y + yz * z
        slips[j, 2, b] = xz * x + yz * y + zz * z

    return slip


@cache
def turn_kernel(real: type) -> wp.Kernel:
    """Compile the kernel that applies the turn of normal forces, in one precision."""
    vec3, Values = wp.types.vector(3, real), wp.types.matrix((6, 3), real)

    @wp.kernel(module="unique", enable_backward=False)
    def turned(
        p: wp.array3d(dtype=real),
        faces: wp.array2d(dtype=wp.int32),
        slots: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=real),
        active: wp.array2d(dtype=wp.bool),
        turn: wp.array4d(dtype=wp.float32),
        result: wp.array3d(dtype=real),
    ):
        """Take the turn of normal forces times nodal displacements ``p`` off the nodes; one face."""
        f, b = wp.tid()
        some = wp.int32(0)
        for a in range(6):
            if active[slots[f, a], b]:
                some = 1
        if some == 0:
            return
        change, total = Values(), Values()
        for a in range(6):
            for i in range(3):
                change[a, i] = p[faces[f, a], i, b]
        for k in range(shapes.shape[0]):
            v = vec3()
            for a in range(6):
                v += shapes[k, a] * vec3(change[a, 0], change[a, 1], change[a, 2])
            xx, yy, zz = real(turn[f, k, 0, b]), real(turn[f, k, 1, b]), real(turn[f, k, 2, b])
            xy, yz, xz = real(turn[f, k, 3, b]), real(turn[f, k, 4, b]), real(turn[f, k, 5, b])
            r = vec3(
                xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2], xz * v[0] + yz * v[1] + zz * v[2]
            )
            for a in range(6):
                for i in range(3):
                    total[a, i] = total[a, i] + shapes[k, a] * r[i]
        for a in range(6):
            for i in range(3):
                wp.atomic_sub(result, faces[f, a], i, b, total[a, i])

    return turned
