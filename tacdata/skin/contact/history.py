"""Memory of contact: the state from which friction started."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.pose import Pose


@dataclass(frozen=True)
class ContactHistory(Columns):
    """Memory of a contact from one equilibrium to the next; s contact nodes, b batch members."""

    anchor: torch.Tensor
    """Mean place of each hat in the shape's frame at the last equilibrium [mm], shape (s, 3, b)."""
    held: torch.Tensor
    """Shear traction, in the shape's frame, at the last equilibrium [MPa], shape (s, 3, b)."""
    gap: torch.Tensor
    """Mean gap at the last equilibrium [mm], 0 where closed, shape (s, b)."""
    place: torch.Tensor
    """Place of the shape at the last equilibrium [mm], shape (3, b)."""

    def accept(self, forces: ContactForces, pose: Pose, which: torch.Tensor) -> None:
        """Make the present state of the members in ``which``, shape (b,), the one that friction starts from."""
        # A gap closes only to the solver's tolerance. The remainder would delay friction (`share_in_contact`).
        gap = torch.where(forces.pressure > 0, torch.zeros_like(forces.gap), forces.gap)
        self.put_where(which, type(self)(forces.local, forces.shear, gap, pose.place))
