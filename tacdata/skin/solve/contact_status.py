"""Members whose contact has changed its status in a Newton step."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface


class ContactStatus:
    """Status of every contact node of a batch before the present step: open, sticking or slipping."""

    def __init__(self, surfaces: Sequence[ContactSurface]) -> None:
        """Begin without a status."""
        self._surfaces = surfaces
        self._before: tuple[torch.Tensor, ...] = ()

    def note(self, contacts: Sequence[ContactForces], friction: torch.Tensor) -> None:
        """Note the status from which a step goes out; ``friction``: of each member, shape (b,)."""
        self._before = self._of(contacts, friction)

    def changed(self, contacts: Sequence[ContactForces], friction: torch.Tensor) -> torch.Tensor:
        """Return in which members a node has another status than was noted, shape (b,), bool."""
        change = torch.zeros_like(friction, dtype=torch.bool)
        # Not strict: before the first step there is no noted status, and so no change.
        for previous, current in zip(self._before, self._of(contacts, friction), strict=False):
            change |= (previous != current).any(dim=0)
        return change

    def keep(self, which: torch.Tensor) -> None:
        """Keep some columns, by index."""
        self._before = tuple(status[:, which] for status in self._before)

    def _of(self, contacts: Sequence[ContactForces], friction: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return tuple(surface.status(forces, friction) for surface, forces in zip(self._surfaces, contacts, strict=True))
