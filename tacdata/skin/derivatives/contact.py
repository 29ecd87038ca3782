# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Directional derivatives of `tacdata.skin.contact.contact`, with respect to everything that its tractions depend on.

Every point keeps its status (open, sticking, slipping, just reached); within one, tractions are smooth. Unlike the
solver's stiffness, which is kept symmetric, the derivative holds the turn of the normal and the change of friction's
disc with pressure. The curvature of the shape and the change of its distance with its sizes are taken by
central differences of its distance function: they alone, so that the derivative is linear in its direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import torch
import warp as wp

from tacdata.skin.contact.contact import Contact, ContactState, Parameters
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose


@cache
def _change(distance):
    """Compile the kernel for one shape."""

    @wp.func
    def read(values: wp.array4d(dtype=wp.float64), f: int, k: int, b: int):
        return wp.vec3d(values[f, k, 0, b], values[f, k, 1, b], values[f, k, 2, b])

    @wp.func
    def column(values: wp.array2d(dtype=wp.float64), b: int):
        return wp.vec3d(values[0, b], values[1, b], values[2, b])

    @wp.func
    def numbers(values: wp.array2d(dtype=wp.float64), b: int):
        q = Parameters()
        for i in range(8):
            q[i] = values[i, b]
        return q

    @wp.func
    def square(turn: wp.array3d(dtype=wp.float64), b: int):
        return wp.mat33d(
            turn[0, 0, b], turn[0, 1, b], turn[0, 2, b], turn[1, 0, b], turn[1, 1, b], turn[1, 2, b],
            turn[2, 0, b], turn[2, 1, b], turn[2, 2, b],
        )

    @wp.func
    def normal(p: wp.vec3d, q: Parameters):
        h, zero = wp.float64(1.0e-6), wp.float64(0.0)
        return wp.normalize(wp.vec3d(
            distance(p + wp.vec3d(h, zero, zero), q) - distance(p - wp.vec3d(h, zero, zero), q),
            distance(p + wp.vec3d(zero, h, zero), q) - distance(p - wp.vec3d(zero, h, zero), q),
            distance(p + wp.vec3d(zero, zero, h), q) - distance(p - wp.vec3d(zero, zero, h), q),
        ))

    @wp.func
    def turn_of_normal(p: wp.vec3d, dp: wp.vec3d, q: Parameters, dq: Parameters):
        """Change of the normal [1] at a point that moves while the shape changes."""
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

    @wp.kernel(module="unique", enable_backward=False)
    def change(
        u: wp.array3d(dtype=wp.float64), du: wp.array3d(dtype=wp.float64),
        nodes: wp.array2d(dtype=wp.float64), faces: wp.array2d(dtype=wp.int32),
        shapes: wp.array2d(dtype=wp.float64), weights: wp.array2d(dtype=wp.float64),
        thickness: wp.array(dtype=wp.float64), d_thickness: wp.array(dtype=wp.float64),
        modulus: wp.array(dtype=wp.float64), d_modulus: wp.array(dtype=wp.float64),
        coefficient: wp.array(dtype=wp.float64), d_coefficient: wp.array(dtype=wp.float64),
        parameters: wp.array2d(dtype=wp.float64), d_parameters: wp.array2d(dtype=wp.float64),
        place: wp.array2d(dtype=wp.float64), d_place: wp.array2d(dtype=wp.float64),
        turn: wp.array3d(dtype=wp.float64), d_turn: wp.array3d(dtype=wp.float64),
        multiplier: wp.array3d(dtype=wp.float64), d_multiplier: wp.array3d(dtype=wp.float64),
        anchor: wp.array4d(dtype=wp.float64), d_anchor: wp.array4d(dtype=wp.float64),
        held: wp.array4d(dtype=wp.float64), d_held: wp.array4d(dtype=wp.float64),
        gap_before: wp.array3d(dtype=wp.float64), d_gap_before: wp.array3d(dtype=wp.float64),
        place_before: wp.array2d(dtype=wp.float64), d_place_before: wp.array2d(dtype=wp.float64),
        penalty_over_modulus: wp.float64, stick_over_modulus: wp.float64, rough: int,
        pressure: wp.array3d(dtype=wp.float64), whole: int,
        d_force: wp.array3d(dtype=wp.float64), d_gap: wp.array3d(dtype=wp.float64),
        d_pressure: wp.array3d(dtype=wp.float64), d_shear: wp.array4d(dtype=wp.float64),
        d_local: wp.array4d(dtype=wp.float64),
    ):
        f, k, b = wp.tid()
        if whole == 0 and pressure[f, k, b] <= wp.float64(0.0):
            return
        zero, one, two = wp.float64(0.0), wp.float64(1.0), wp.float64(2.0)
        q, dq = numbers(parameters, b), numbers(d_parameters, b)
        R, dR = square(turn, b), square(d_turn, b)
        tip, d_tip = column(place, b), column(d_place, b)
        penalty, stick = penalty_over_modulus * modulus[b], stick_over_modulus * modulus[b]
        x, dx = wp.vec3d(), wp.vec3d()
        for a in range(6):
            n = faces[f, a]
            z = nodes[n, 2]
            dz = wp.float64(0.0)
            if z > zero:
                dz = z * d_thickness[b]
                z = z * thickness[b]
            x += shapes[k, a] * wp.vec3d(nodes[n, 0] + u[n, 0, b], nodes[n, 1] + u[n, 1, b], z + u[n, 2, b])
            dx += shapes[k, a] * wp.vec3d(du[n, 0, b], du[n, 1, b], du[n, 2, b] + dz)
        local = wp.transpose(R) * (x - tip)
        moves = wp.transpose(R) * (dx - d_tip) + wp.transpose(dR) * (x - tip)
        for i in range(3):
            d_local[f, k, i, b] = moves[i]
        normal_here = normal(local, q)
        dg = wp.dot(normal_here, moves)
        size_q = wp.length(dq)
        if size_q > wp.float64(1.0e-30):
            e = wp.float64(1.0e-5) / size_q
            dg += (distance(local, q + e * dq) - distance(local, q - e * dq)) / (two * e)
        d_gap[f, k, b] = dg
        g = distance(local, q)
        t = multiplier[f, k, b] - penalty * g
        if t > zero:
            d_stick = stick_over_modulus * d_modulus[b]
            dt = d_multiplier[f, k, b] - penalty * dg - penalty_over_modulus * d_modulus[b] * g
            d_pressure[f, k, b] = dt
            dn = turn_of_normal(local, moves, q, dq)
            total, d_total = t * normal_here, dt * normal_here + t * dn
            friction = coefficient[b]
            if rough == 1 and friction > zero:
                step = tip - column(place_before, b)
                moved = wp.transpose(R) * step
                d_moved = wp.transpose(dR) * step + wp.transpose(R) * (d_tip - column(d_place_before, b))
                after = wp.float64(1.0)
                d_after = wp.float64(0.0)
                before = gap_before[f, k, b]
                if before > zero:
                    after = wp.float64(0.0)
                    approach = wp.dot(moved, normal_here)
                    if approach > before:
                        after = one - before / approach
                        d_approach = wp.dot(d_moved, normal_here) + wp.dot(moved, dn)
                        d_after = (before * d_approach / approach - d_gap_before[f, k, b]) / approach
                slid, d_slid = local - read(anchor, f, k, b), moves - read(d_anchor, f, k, b)
                w = read(held, f, k, b) - stick * after * slid
                dw = read(d_held, f, k, b) - stick * after * d_slid - (stick * d_after + d_stick * after) * slid
                shear = w - normal_here * wp.dot(normal_here, w)
                d_sheared = (
                    dw - dn * wp.dot(normal_here, w) - normal_here * (wp.dot(dn, w) + wp.dot(normal_here, dw))
                )
                size = wp.length(shear)
                if size > friction * t:
                    along = shear / size
                    across = d_sheared - along * wp.dot(along, d_sheared)
                    shear = friction * t * along
                    d_sheared = (d_coefficient[b] * t + friction * dt) * along + (friction * t / size) * across
                for i in range(3):
                    d_shear[f, k, i, b] = d_sheared[i]
                total += shear
                d_total += d_sheared
            d_total = R * d_total + dR * total
            for a in range(6):
                for i in range(3):
                    wp.atomic_add(d_force, faces[f, a], i, b, shapes[k, a] * weights[f, k] * d_total[i])

    return change


@dataclass(frozen=True)
class ConditionsChange:
    """Directions in which conditions and the indenter's pose change, one a member."""

    conditions: Conditions
    """Changes of law [as the law says], modulus [MPa], thickness [1], friction [1] and indenter [mm, rad]."""
    pose: Pose
    """Changes of place [mm] and turn [1]."""

    def still(self) -> ConditionsChange:
        """Return the same conditions and the pose unchanged: zeros."""
        zero = Conditions(
            *(torch.zeros_like(getattr(self.conditions, name)) for name in
              ("law", "modulus", "thickness", "friction", "indenter"))
        )
        return ConditionsChange(zero, Pose(torch.zeros_like(self.pose.place), torch.zeros_like(self.pose.turn)))


@dataclass(frozen=True)
class ContactChange:
    """Derivatives of one contact along directions."""

    force: torch.Tensor
    """Of the nodal forces on the skin [N], shape (n, 3, b)."""
    gap: torch.Tensor
    """Of the gap [mm], shape (f, k, b)."""
    pressure: torch.Tensor
    """Of the normal traction [MPa], shape (f, k, b); zero where open."""
    shear: torch.Tensor
    """Of the tangential traction in the shape's frame [MPa], shape (f, k, 3, b)."""
    local: torch.Tensor
    """Of each point's place in the shape's frame [mm], shape (f, k, 3, b)."""
    load: torch.Tensor
    """Of the normal force on each face [N], shape (f, b)."""

    def accepted(self, open_: torch.Tensor, place: torch.Tensor) -> ContactState:
        """Return the change of the history when the state is accepted (`Contact.accept`).

        Args:
            open_: Points without contact, shape (f, k, b), bool.
            place: Change of the shape's place [mm], shape (3, b).
        """
        return ContactState(self.pressure, self.local, self.shear, torch.where(open_, self.gap, 0.0), place)


def contact_change(
    contact: Contact, distance: wp.Function, u: torch.Tensor, pose: Pose, state: ContactState, conditions: Conditions,
    du: torch.Tensor, change: ConditionsChange, history: ContactState, whole: bool = True,
) -> ContactChange:
    """Return how a contact changes along directions, at fixed status of its points.

    Args:
        contact: The contact.
        distance: Signed distance of its shape.
        u: Displacements [mm], shape (n, 3, b), float64.
        pose: Of the shape.
        state: History that the state at ``u`` starts from.
        conditions: Of the members.
        du: Change of ``u`` along each member's direction [mm], shape (n, 3, c), perhaps of the first c members alone.
        change: Change of conditions and pose.
        history: Change of the history.
        whole: Whether gaps and places of open points are asked for, too, in which no force changes; else they are 0.
    """
    f, k = contact.weights.shape
    pairs = [
        (conditions.thickness, change.conditions.thickness), (conditions.modulus, change.conditions.modulus),
        (conditions.friction, change.conditions.friction), (conditions.indenter, change.conditions.indenter),
        (pose.place, change.pose.place), (pose.turn, change.pose.turn), (state.multiplier, history.multiplier),
        (state.anchor, history.anchor), (state.held, history.held), (state.gap, history.gap),
        (state.place, history.place),
    ]
    fields = [u, du, contact.nodes, contact.faces, contact.shapes, contact.weights]
    fields += [value.contiguous() for pair in pairs for value in pair]

    def zeros(*shape: int) -> torch.Tensor:
        return torch.zeros(f, k, *shape, du.shape[2], dtype=torch.float64, device=u.device)

    outputs = [torch.zeros_like(du), zeros(), zeros(), zeros(3), zeros(3)]
    wp.launch(
        _change(distance), dim=(f, k, du.shape[2]),
        inputs=[*(wp.from_torch(value) for value in fields), contact.penalty, contact.stick, int(contact.rough),
                wp.from_torch(contact.pressure), int(whole)],
        outputs=[wp.from_torch(value) for value in outputs], device=str(u.device),
    )
    return ContactChange(*outputs, load=(outputs[2] * contact.weights[:, :, None]).sum(dim=1))
