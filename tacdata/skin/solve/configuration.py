"""The state of a batch: all that decides the forces of each member."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact.history import ContactHistory
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose


@dataclass(frozen=True)
class Unknowns(Columns):
    """Unknowns of Newton's method; one column a member."""

    u: torch.Tensor
    """Displacements [mm], shape (n, 3, b), float64."""
    multipliers: tuple[torch.Tensor, ...]
    """Normal tractions at the nodes of each contact [MPa], shape (s, b), float64."""

    def plus(self, change: Unknowns, factor: torch.Tensor | float = 1.0) -> Unknowns:
        """Return the sum with others, times a factor, shape (b,)."""
        pairs = zip((self.u, *self.multipliers), (change.u, *change.multipliers), strict=True)
        if isinstance(factor, torch.Tensor):
            u, *multipliers = (torch.addcmul(a, b, factor) for a, b in pairs)
        else:
            u, *multipliers = (torch.add(a, b, alpha=factor) for a, b in pairs)
        return Unknowns(u, tuple(multipliers))

    def minus(self, reference: Unknowns) -> Unknowns:
        """Return the difference from others."""
        return self.plus(reference, -1.0)

    def flatten(self, which: torch.Tensor) -> None:
        """Set members, by index, shape (k,), to 0, in place."""
        for field in (self.u, *self.multipliers):
            field.index_fill_(-1, which, 0.0)

    def single(self) -> Unknowns:
        """Return a copy in single precision."""
        return Unknowns(self.u.to(torch.float32), tuple(part.to(torch.float32) for part in self.multipliers))

    def where(self, mask: torch.Tensor, alternative: Unknowns) -> Unknowns:
        """Return these members where ``mask``, shape (b,), holds, else those of ``alternative``."""
        pairs = zip(self.multipliers, alternative.multipliers, strict=True)
        return Unknowns(torch.where(mask, self.u, alternative.u), tuple(torch.where(mask, a, b) for a, b in pairs))


@dataclass
class Configuration(Columns):
    """Places of skin and shapes, their properties, and the memory of contact; one column a member."""

    u: torch.Tensor
    """Displacements [mm], shape (n, 3, b), float64."""
    multipliers: tuple[torch.Tensor, ...]
    """Normal tractions at the nodes of each contact [MPa], shape (s, b), float64."""
    conditions: Conditions
    """Of the members."""
    poses: tuple[Pose, ...]
    """Of each contact's shape."""
    histories: tuple[ContactHistory, ...]
    """Of each contact."""
    friction_tangent: torch.Tensor
    """Stiffness of slipping nodes, from 0, the secant of friction, to 1, its tangent, shape (b,)."""
    near: torch.Tensor
    """Gap up to which nodes without pressure are active, too [mm], shape (b,)."""

    @property
    def unknowns(self) -> Unknowns:
        """Displacements and multipliers."""
        return Unknowns(self.u, self.multipliers)

    @unknowns.setter
    def unknowns(self, value: Unknowns) -> None:
        self.u, self.multipliers = value.u, value.multipliers
