"""Warp kernels of `tacdata.skin.derivatives.contact`: how gaps, normal forces and friction change along a direction.

Indices as in `tacdata.skin.contact.kernels`; the structs of `kernel_data` hold the changes too.
"""

from functools import cache

from tacdata.skin.contact.kernel_data import HistoryData, MemberData, Nodal, Parameters, Six, SurfaceData
from tacdata.skin.contact.kernels import (
    at_node,
    deformed_point,
    normal_function,
    of_member,
    parameters_of,
    rotation_of,
    share_in_contact,
)
from tacdata.warp_runtime import wp


@wp.func
def point_change(displacement: wp.array3d(dtype=wp.float64), surface: SurfaceData, f: int, k: int, b: int):
    """Return the change of `deformed_point` [mm]; ``displacement`` holds that of the nodes' places."""
    dx = wp.vec3d()
    for a in range(6):
        n = surface.faces[f, a]
        dx += surface.shapes[k, a] * wp.vec3d(displacement[n, 0, b], displacement[n, 1, b], displacement[n, 2, b])
    return dx


@wp.func
def share_change(gap: wp.float64, d_gap: wp.float64, approach: wp.float64, d_approach: wp.float64):
    """Return the change of `share_in_contact` [1]."""
    change = wp.float64(0.0)
    # Derivative of 1 - gap/approach; the share of a node that was closed (1) or is not reached (0) is constant.
    if gap > wp.float64(0.0):
        if approach > gap:
            change = (gap * d_approach / approach - d_gap) / approach
    return change


@wp.func
def return_mapping_change(trial: wp.vec3d, d_trial: wp.vec3d, limit: wp.float64, d_limit: wp.float64):
    """Return a trial shear traction mapped back onto the disc of radius ``limit``, and its change."""
    shear, change = trial, d_trial
    size = wp.length(trial)
    if size > limit:
        direction = trial / size
        # Only the part of the change across the direction turns it; the disc cuts off the part along it.
        transverse = d_trial - direction * wp.dot(direction, d_trial)
        shear = limit * direction
        change = d_limit * direction + (limit / size) * transverse
    return shear, change


@cache
def turn_of_normal_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, dp, q, dq)``: the change of the normal [1] at a place that moves while the shape changes."""
    normal = normal_function(distance)

    @wp.func
    def turn_of_normal(p: wp.vec3d, dp: wp.vec3d, q: Parameters, dq: Parameters):
        # Far above the rounding of the normal (4e-10), far below any radius of curvature.
        step, smallest = wp.float64(1.0e-4), wp.float64(1.0e-30)
        result = wp.vec3d()
        size = wp.length(dp)
        if size > smallest:
            e = step / size
            result += (normal(p + e * dp, q) - normal(p - e * dp, q)) / (wp.float64(2.0) * e)
        size = wp.length(dq)
        if size > smallest:
            e = step / size
            result += (normal(p, q + e * dq) - normal(p, q - e * dq)) / (wp.float64(2.0) * e)
        return result

    return turn_of_normal


@cache
def gap_change_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, dp, n, q, dq)``: the change of the gap [mm]; ``n`` is the normal at ``p``."""

    @wp.func
    def gap_change(p: wp.vec3d, dp: wp.vec3d, n: wp.vec3d, q: Parameters, dq: Parameters):
        # The gradient of a distance is its unit normal.
        change = wp.dot(n, dp)
        size = wp.length(dq)
        if size > wp.float64(1.0e-30):
            e = wp.float64(1.0e-5) / size
            change += (distance(p, q + e * dq) - distance(p, q - e * dq)) / (wp.float64(2.0) * e)
        return change

    return gap_change


@cache
def normal_change_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel of gaps, normals and normal forces for one shape."""
    normal, turn_of_normal = normal_function(distance), turn_of_normal_function(distance)
    gap_change = gap_change_function(distance)

    @wp.kernel(module="unique", enable_backward=False)
    def change(
        u: wp.array3d(dtype=wp.float64),
        displacement: wp.array3d(dtype=wp.float64),
        surface: SurfaceData,
        members: MemberData,
        d_members: MemberData,
        pressure: wp.array2d(dtype=wp.float64),
        d_pressure: wp.array2d(dtype=wp.float64),
        active: wp.array2d(dtype=wp.bool),
        full: int,
        d_gap: wp.array2d(dtype=wp.float64),
        d_force: wp.array3d(dtype=wp.float64),
        mean: wp.array3d(dtype=wp.float64),
        d_mean: wp.array3d(dtype=wp.float64),
    ):
        """Add the changes of one face to its nodes; mean normals and their changes in the shape's frame.

        1. Place of each point in the shape's frame, and how it moves there.
        2. Change of the gap, to the means under the hats.
        3. Under active nodes: the normal and its turn, to the means under the hats.
        4. There, too: change of pressure times normal, to the face's nodes.
        """
        f, b = wp.tid()
        some = wp.int32(0)
        values, d_values = Six(), Six()
        for a in range(6):
            j = surface.slots[f, a]
            if active[j, b]:
                some = 1
                values[a] = pressure[j, b]
                d_values[a] = d_pressure[j, b]
        if some == 0 and full == 0:
            return
        q, dq = parameters_of(members.indenter, b), parameters_of(d_members.indenter, b)
        R, dR = rotation_of(members.turn, b), rotation_of(d_members.turn, b)
        tip, d_tip = of_member(members.place, b), of_member(d_members.place, b)
        gaps, total, means, d_means = Six(), Nodal(), Nodal(), Nodal()
        for k in range(surface.weights.shape[1]):
            w = surface.weights[f, k]
            x = deformed_point(u, surface, f, k, b, members.thickness[b]) - tip
            local = wp.transpose(R) * x
            # local = R^T x: when the shape turns, a point at rest moves in its frame.
            moves = wp.transpose(R) * (point_change(displacement, surface, f, k, b) - d_tip) + wp.transpose(dR) * x
            n = normal(local, q)
            dg = gap_change(local, moves, n, q, dq)
            for a in range(6):
                gaps[a] = gaps[a] + surface.hats[k, a] * w * dg
            if some == 1:
                dn = turn_of_normal(local, moves, q, dq)
                p, dp = wp.float64(0.0), wp.float64(0.0)
                for a in range(6):
                    p += surface.hats[k, a] * values[a]
                    dp += surface.hats[k, a] * d_values[a]
                dt = R * (dp * n + p * dn) + dR * (p * n)
                for a in range(6):
                    for i in range(3):
                        total[a, i] = total[a, i] + surface.shapes[k, a] * w * dt[i]
                        means[a, i] = means[a, i] + surface.hats[k, a] * w * n[i]
                        d_means[a, i] = d_means[a, i] + surface.hats[k, a] * w * dn[i]
        for a in range(6):
            j = surface.slots[f, a]
            wp.atomic_add(d_gap, j, b, gaps[a] / surface.area[j])
            if some == 1:
                for i in range(3):
                    wp.atomic_add(d_force, surface.faces[f, a], i, b, total[a, i])
                    wp.atomic_add(mean, j, i, b, means[a, i] / surface.area[j])
                    wp.atomic_add(d_mean, j, i, b, d_means[a, i] / surface.area[j])

    return change


@wp.kernel(enable_backward=False)
def friction_change(
    local: wp.array3d(dtype=wp.float64),
    d_place: wp.array3d(dtype=wp.float64),
    surface: SurfaceData,
    members: MemberData,
    d_members: MemberData,
    history: HistoryData,
    d_history: HistoryData,
    pressure: wp.array2d(dtype=wp.float64),
    d_pressure: wp.array2d(dtype=wp.float64),
    active: wp.array2d(dtype=wp.bool),
    mean: wp.array3d(dtype=wp.float64),
    d_mean: wp.array3d(dtype=wp.float64),
    d_local: wp.array3d(dtype=wp.float64),
    d_shear: wp.array3d(dtype=wp.float64),
    d_force: wp.array3d(dtype=wp.float64),
):
    """Change of one hat's friction.

    1. Change of the hat's mean place in the shape's frame.
    2. Turn of the mean normal, which has unit length.
    3. Trial shear and its change, projected onto the tangent plane.
    4. Return mapping onto Coulomb's disc, whose radius changes with the pressure.
    5. Force on the hat, in the sensor's frame.
    """
    j, b = wp.tid()
    zero = wp.float64(0.0)
    R, dR = rotation_of(members.turn, b), rotation_of(d_members.turn, b)
    tip, d_tip = of_member(members.place, b), of_member(d_members.place, b)
    place = at_node(local, j, b)
    # `place` is in the shape's frame; R place is the lever in the sensor's, on which the change of R acts.
    moves = wp.transpose(R) * (at_node(d_place, j, b) - d_tip) + wp.transpose(dR) * (R * place)
    for i in range(3):
        d_local[j, i, b] = moves[i]
    coefficient = members.friction[b]
    if surface.rough == 0 or not active[j, b] or coefficient <= zero:
        return
    mean_normal, turns = at_node(mean, j, b), at_node(d_mean, j, b)
    length = wp.length(mean_normal)
    n = mean_normal / length
    # A unit vector changes only across itself.
    dn = (turns - n * wp.dot(n, turns)) / length
    step = tip - of_member(history.place, b)
    slip = wp.transpose(R) * step
    d_moved = wp.transpose(dR) * step + wp.transpose(R) * (d_tip - of_member(d_history.place, b))
    gap, approach = history.gap[j, b], wp.dot(slip, n)
    d_approach = wp.dot(d_moved, n) + wp.dot(slip, dn)
    share = share_in_contact(gap, approach)
    d_after = share_change(gap, d_history.gap[j, b], approach, d_approach)
    stick, d_stick = surface.stick * members.modulus[b], surface.stick * d_members.modulus[b]
    slid, d_slid = place - at_node(history.anchor, j, b), moves - at_node(d_history.anchor, j, b)
    w = at_node(history.held, j, b) - stick * share * slid
    dw = at_node(d_history.held, j, b) - stick * share * d_slid - (stick * d_after + d_stick * share) * slid
    trial = w - n * wp.dot(n, w)
    d_trial = dw - dn * wp.dot(n, w) - n * (wp.dot(dn, w) + wp.dot(n, dw))
    limit, d_limit = zero, zero
    if pressure[j, b] > zero:
        limit = coefficient * pressure[j, b]
        d_limit = d_members.friction[b] * pressure[j, b] + coefficient * d_pressure[j, b]
    shear, change = return_mapping_change(trial, d_trial, limit, d_limit)
    total = surface.area[j] * (R * change + dR * shear)
    for i in range(3):
        d_shear[j, i, b] = change[i]
        d_force[j, i, b] = total[i]
