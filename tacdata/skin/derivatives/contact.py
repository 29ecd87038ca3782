"""Directional derivatives of contact forces, with respect to everything that they depend on.

Every point keeps its status (open, sticking, slipping, just reached); within one, tractions are smooth. Unlike the
solver's stiffness, which is kept symmetric, the derivative holds the turn of the normal and the change of friction's
disc with pressure. The curvature of the shape, and the change of its distance with its sizes, are central
differences of the distance function. Nothing else is, so that the derivative is linear in its direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import warp as wp

from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.contact.kernels import PointData, history_data, member_data
from tacdata.skin.derivatives.contact_kernel import change_kernel
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose
from tacdata.skin.member.warp_arrays import argument, filled


@dataclass(frozen=True)
class ConditionsChange(Columns):
    """Directions in which conditions and the indenter's pose change, one a member."""

    conditions: Conditions
    """Changes of law [as the law says], modulus [MPa], thickness [1], friction [1] and indenter [mm, rad]."""
    pose: Pose
    """Changes of place [mm] and turn [1]."""


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

    def accepted(self, open_: torch.Tensor, place: torch.Tensor) -> ContactHistory:
        """Return the change of the history when the state is accepted (`ContactHistory.accept`).

        Args:
            open_: Points without contact, shape (f, k, b), bool.
            place: Change of the shape's place [mm], shape (3, b).
        """
        return ContactHistory(self.pressure, self.local, self.shear, torch.where(open_, self.gap, 0.0), place)


@dataclass(frozen=True)
class ContactPoint(Columns):
    """A contact at the state at which it is differentiated; one column a direction."""

    pose: Pose
    """Of the shape."""
    history: ContactHistory
    """That the state starts from."""
    pressure: torch.Tensor
    """Normal tractions there [MPa], shape (f, k, b)."""


def contact_change(
    surface: ContactSurface, u: torch.Tensor, conditions: Conditions, point: ContactPoint, du: torch.Tensor,
    change: ConditionsChange, history: ContactHistory, whole: bool = True,
) -> ContactChange:
    """Return how a contact changes along directions, at fixed status of its points.

    Args:
        surface: The contact.
        u: Displacements [mm], shape (n, 3, b), float64.
        conditions: Of the members.
        point: Pose, history and pressures.
        du: Change of ``u`` along each member's direction [mm], shape (n, 3, c), perhaps of the first c members alone.
        change: Change of conditions and pose.
        history: Change of the history.
        whole: Whether gaps and places of open points are asked for, too, in which no force changes; else they are 0.
    """
    f, k = surface.weights.shape

    def zeros(*shape: int) -> torch.Tensor:
        return torch.zeros(f, k, *shape, du.shape[2], dtype=torch.float64, device=u.device)

    force, gap, pressure, shear, local = torch.zeros_like(du), zeros(), zeros(), zeros(3), zeros(3)
    wp.launch(
        change_kernel(surface.distance), dim=(f, k, du.shape[2]),
        inputs=[
            argument(u), argument(du), surface.data, member_data(conditions, point.pose),
            member_data(change.conditions, change.pose), history_data(point.history), history_data(history),
            argument(point.pressure), int(whole),
        ],
        outputs=[argument(force), filled(PointData, gap=gap, pressure=pressure, shear=shear, local=local)],
        device=surface.device,
    )
    load = (pressure * surface.weights[:, :, None]).sum(dim=1)
    return ContactChange(force, gap, pressure, shear, local, load)
