"""Directional derivatives of gaps and contact forces, with respect to everything that they depend on.

Every node keeps its status (open, sticking, slipping, just reached); within one, tractions are smooth. Unlike the
solver's stiffness, which is kept symmetric, the derivative holds the turn of the normal and the change of friction's
disc with pressure. The curvature of the shape, and the change of its distance with its sizes, are central
differences of the distance function. Nothing else is, so that the derivative is linear in its direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.contact.kernel_data import history_data, member_data
from tacdata.skin.derivatives.contact_kernel import friction_change, normal_change_kernel
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import argument
from tacdata.warp_runtime import wp


@dataclass(frozen=True)
class ConditionsChange(Columns):
    """Directions in which conditions and the indenter's pose change, one a member."""

    conditions: Conditions
    """Changes of law [units of the law], modulus [MPa], thickness [1], friction [1] and indenter [mm, rad]."""
    pose: Pose
    """Changes of place [mm] and turn [1]."""


@dataclass(frozen=True)
class ContactChange:
    """Derivatives of one contact along directions; s contact nodes."""

    force: torch.Tensor
    """Of the nodal forces on the skin [N], shape (n, 3, b)."""
    gap: torch.Tensor
    """Of the mean gap under each hat [mm], shape (s, b)."""
    pressure: torch.Tensor
    """Of the normal traction at the nodes [MPa], shape (s, b); zero where open."""
    shear: torch.Tensor
    """Of the tangential traction in the shape's frame [MPa], shape (s, 3, b)."""
    local: torch.Tensor
    """Of each hat's mean place in the shape's frame [mm], shape (s, 3, b)."""
    load: torch.Tensor
    """Of the normal force at each node [N], shape (s, b)."""

    def accepted(self, carries: torch.Tensor, place: torch.Tensor) -> ContactHistory:
        """Return the change of the history when the state is accepted (`ContactHistory.accept`).

        Args:
            carries: Nodes with pressure, shape (s, b), bool.
            place: Change of the shape's place [mm], shape (3, b).
        """
        return ContactHistory(self.local, self.shear, torch.where(carries, 0.0, self.gap), place)


@dataclass(frozen=True)
class ContactPoint(Columns):
    """A contact at the state at which it is differentiated; one column a direction."""

    pose: Pose
    """Of the shape."""
    history: ContactHistory
    """That the state starts from."""
    now: ContactForces
    """Tractions there."""


def contact_change(
    surface: ContactSurface,
    u: torch.Tensor,
    conditions: Conditions,
    point: ContactPoint,
    du: torch.Tensor,
    pressure: torch.Tensor,
    change: ConditionsChange,
    history: ContactHistory,
    full: bool = True,
) -> ContactChange:
    """Return how a contact changes along directions, at fixed status of its nodes.

    Args:
        surface: The contact.
        u: Displacements [mm], shape (n, 3, b), float64.
        conditions: Of the members.
        point: Pose, history and tractions.
        du: Change of ``u`` along each member's direction [mm], shape (n, 3, c), perhaps of the first c members alone.
        pressure: Change of the normal traction at the nodes [MPa], shape (s, c); that of open ones is taken as 0.
        change: Change of conditions and pose.
        history: Change of the history.
        full: Whether gaps of open nodes are asked for, too; else those far from contact are 0.
    """
    count, c = surface.count, du.shape[2]

    def zeros(*shape: int) -> torch.Tensor:
        return torch.zeros(count, *shape, c, dtype=torch.float64, device=u.device)

    displacement = du.clone()
    # A thicker slab lifts everything above z = 0.
    displacement[:, 2] += wp.to_torch(surface.data.nodes)[:, 2:].clamp_min(0.0) * change.conditions.thickness[:c]
    forces = point.now
    # The status of nodes is held fixed. At a state where a node just opens the derivative is one-sided.
    active = forces.tangent.active
    pressure = torch.where(active[:, :c], pressure, 0.0)
    members, d_members = member_data(conditions, point.pose), member_data(change.conditions, change.pose)
    carried = argument(forces.pressure), argument(pressure), argument(active)
    force, gap, mean, d_mean = torch.zeros_like(displacement), zeros(), zeros(3), zeros(3)
    wp.launch(
        normal_change_kernel(surface.only),
        dim=(len(surface.faces), c),
        inputs=[argument(u), argument(displacement), surface.data, members, d_members, *carried, int(full)],
        outputs=[argument(value) for value in (gap, force, mean, d_mean)],
        device=surface.device,
    )
    local, shear, rub = zeros(3), zeros(3), zeros(3)
    wp.launch(
        friction_change,
        dim=(count, c),
        inputs=[
            argument(forces.local),
            argument(surface.mortar.means(displacement)),
            surface.data,
            members,
            d_members,
            history_data(point.history),
            history_data(history),
            *carried,
            argument(mean),
            argument(d_mean),
        ],
        outputs=[argument(value) for value in (local, shear, rub)],
        device=surface.device,
    )
    if surface.rough:
        surface.mortar.spread(rub, force)
    return ContactChange(force, gap, pressure, shear, local, pressure * surface.area[:, None])
