"""What contact remembers: multipliers of the augmented Lagrangian, and where friction started from."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.pose import Pose


@dataclass(frozen=True)
class ContactHistory(Columns):
    """What one contact carries from one equilibrium to the next; f faces, k points each, b batch members."""

    multiplier: torch.Tensor
    """Normal traction of the augmented Lagrangian [MPa], shape (f, k, b)."""
    anchor: torch.Tensor
    """Place of each point in the shape's frame at the last equilibrium [mm], shape (f, k, 3, b)."""
    held: torch.Tensor
    """Shear traction, in the shape's frame, at the last equilibrium [MPa], shape (f, k, 3, b)."""
    gap: torch.Tensor
    """Gap at the last equilibrium [mm], 0 where closed, shape (f, k, b)."""
    place: torch.Tensor
    """Place of the shape at the last equilibrium [mm], shape (3, b)."""

    def augment(self, now: ContactForces, which: torch.Tensor) -> None:
        """Take the present normal tractions of the members in ``which``, shape (b,), as multipliers (Uzawa's step)."""
        self.multiplier.copy_(torch.where(which, now.pressure, self.multiplier))

    def accept(self, now: ContactForces, pose: Pose, which: torch.Tensor) -> None:
        """Make the present state of the members in ``which``, shape (b,), the one that friction starts from.

        Its pressures become the multipliers of the next, so that penetration answers to the increment of load alone.
        """
        closed = now.pressure > 0
        gap = torch.where(closed, torch.zeros_like(now.gap), now.gap)
        self.put_where(which, type(self)(now.pressure, now.local, now.shear, gap, pose.place))
