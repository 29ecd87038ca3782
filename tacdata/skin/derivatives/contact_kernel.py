# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false, reportInvalidTypeForm=false
"""Warp kernel of `tacdata.skin.derivatives.contact`: the change of one point's tractions along a direction.

Indices as in `tacdata.skin.contact.kernels`, whose structs hold the changes too.
"""

from functools import cache

import warp as wp

from tacdata.skin.contact.kernels import (
    HistoryData,
    MemberData,
    Parameters,
    PointData,
    SurfaceData,
    at_point,
    deformed_point,
    normal_function,
    of_member,
    parameters_of,
    rotation_of,
    share_in_contact,
)


@wp.func
def point_change(
    du: wp.array3d(dtype=wp.float64), surface: SurfaceData, f: int, k: int, b: int, d_thickness: wp.float64
):
    """Return the change of `deformed_point` [mm]."""
    dx = wp.vec3d()
    for a in range(6):
        n = surface.faces[f, a]
        z = surface.nodes[n, 2]
        dz = wp.float64(0.0)
        if z > wp.float64(0.0):
            dz = z * d_thickness
        dx += surface.shapes[k, a] * wp.vec3d(du[n, 0, b], du[n, 1, b], du[n, 2, b] + dz)
    return dx


@wp.func
def share_change(before: wp.float64, d_before: wp.float64, approach: wp.float64, d_approach: wp.float64):
    """Return the change of `share_in_contact` [1]."""
    change = wp.float64(0.0)
    if before > wp.float64(0.0):
        if approach > before:
            change = (before * d_approach / approach - d_before) / approach
    return change


@wp.func
def return_mapping_change(trial: wp.vec3d, d_trial: wp.vec3d, limit: wp.float64, d_limit: wp.float64):
    """Return a trial shear traction mapped back onto the disc of radius ``limit``, and its change."""
    shear, change = trial, d_trial
    size = wp.length(trial)
    if size > limit:
        along = trial / size
        across = d_trial - along * wp.dot(along, d_trial)
        shear = limit * along
        change = d_limit * along + (limit / size) * across
    return shear, change


@cache
def turn_of_normal_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, dp, q, dq)``: the change of the normal [1] at a place that moves while the shape changes."""
    normal = normal_function(distance)

    @wp.func
    def turn_of_normal(p: wp.vec3d, dp: wp.vec3d, q: Parameters, dq: Parameters):
        # Far above the rounding of the normal (4e-10), far below any radius of curvature.
        step, least = wp.float64(1.0e-4), wp.float64(1.0e-30)
        result = wp.vec3d()
        size = wp.length(dp)
        if size > least:
            e = step / size
            result += (normal(p + e * dp, q) - normal(p - e * dp, q)) / (wp.float64(2.0) * e)
        size = wp.length(dq)
        if size > least:
            e = step / size
            result += (normal(p, q + e * dq) - normal(p, q - e * dq)) / (wp.float64(2.0) * e)
        return result

    return turn_of_normal


@cache
def gap_change_function(distance: wp.Function) -> wp.Function:
    """Return ``f(p, dp, n, q, dq)``: the change of the gap [mm]; ``n`` is the normal at ``p``."""

    @wp.func
    def gap_change(p: wp.vec3d, dp: wp.vec3d, n: wp.vec3d, q: Parameters, dq: Parameters):
        change = wp.dot(n, dp)
        size = wp.length(dq)
        if size > wp.float64(1.0e-30):
            e = wp.float64(1.0e-5) / size
            change += (distance(p, q + e * dq) - distance(p, q - e * dq)) / (wp.float64(2.0) * e)
        return change

    return gap_change


@cache
def change_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel for one shape."""
    normal, turn_of_normal = normal_function(distance), turn_of_normal_function(distance)
    gap_change = gap_change_function(distance)

    @wp.kernel(module="unique", enable_backward=False)
    def change(
        u: wp.array3d(dtype=wp.float64), du: wp.array3d(dtype=wp.float64), surface: SurfaceData,
        members: MemberData, d_members: MemberData, history: HistoryData, d_history: HistoryData,
        pressure: wp.array3d(dtype=wp.float64), whole: int,
        d_force: wp.array3d(dtype=wp.float64), d_found: PointData,
    ):
        """Change of one point's tractions, added to the nodes.

        1. Place of the point in the shape's frame, and how it moves there.
        2. Change of the gap, and of the normal traction.
        3. Trial shear and its change, projected onto the tangent plane.
        4. Return mapping onto Coulomb's disc, whose radius changes with the pressure.
        5. Forces on the face's nodes.
        """
        f, k, b = wp.tid()
        zero = wp.float64(0.0)
        if whole == 0 and pressure[f, k, b] <= zero:
            return
        q, dq = parameters_of(members.indenter, b), parameters_of(d_members.indenter, b)
        R, dR = rotation_of(members.turn, b), rotation_of(d_members.turn, b)
        tip, d_tip = of_member(members.place, b), of_member(d_members.place, b)
        penalty, stick = surface.penalty * members.modulus[b], surface.stick * members.modulus[b]
        x = deformed_point(u, surface, f, k, b, members.thickness[b])
        dx = point_change(du, surface, f, k, b, d_members.thickness[b])
        local = wp.transpose(R) * (x - tip)
        moves = wp.transpose(R) * (dx - d_tip) + wp.transpose(dR) * (x - tip)
        for i in range(3):
            d_found.local[f, k, i, b] = moves[i]
        n = normal(local, q)
        dg = gap_change(local, moves, n, q, dq)
        d_found.gap[f, k, b] = dg
        g = distance(local, q)
        t = history.multiplier[f, k, b] - penalty * g
        if t > zero:
            d_stick = surface.stick * d_members.modulus[b]
            dt = d_history.multiplier[f, k, b] - penalty * dg - surface.penalty * d_members.modulus[b] * g
            d_found.pressure[f, k, b] = dt
            dn = turn_of_normal(local, moves, q, dq)
            total, d_total = t * n, dt * n + t * dn
            coefficient = members.friction[b]
            if surface.rough == 1 and coefficient > zero:
                step = tip - of_member(history.place, b)
                moved = wp.transpose(R) * step
                d_moved = wp.transpose(dR) * step + wp.transpose(R) * (d_tip - of_member(d_history.place, b))
                before, approach = history.gap[f, k, b], wp.dot(moved, n)
                d_approach = wp.dot(d_moved, n) + wp.dot(moved, dn)
                after = share_in_contact(before, approach)
                d_after = share_change(before, d_history.gap[f, k, b], approach, d_approach)
                slid, d_slid = local - at_point(history.anchor, f, k, b), moves - at_point(d_history.anchor, f, k, b)
                w = at_point(history.held, f, k, b) - stick * after * slid
                dw = (
                    at_point(d_history.held, f, k, b)
                    - stick * after * d_slid - (stick * d_after + d_stick * after) * slid
                )
                trial = w - n * wp.dot(n, w)
                d_trial = dw - dn * wp.dot(n, w) - n * (wp.dot(dn, w) + wp.dot(n, dw))
                d_limit = d_members.friction[b] * t + coefficient * dt
                shear, d_shear = return_mapping_change(trial, d_trial, coefficient * t, d_limit)
                for i in range(3):
                    d_found.shear[f, k, i, b] = d_shear[i]
                total += shear
                d_total += d_shear
            d_total = R * d_total + dR * total
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(
                        d_force, surface.faces[f, a], i, b, surface.shapes[k, a] * surface.weights[f, k] * d_total[i]
                    )

    return change
