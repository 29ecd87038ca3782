"""The tangent stiffness K of body and contacts at one state, matrix-free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions


@dataclass(frozen=True)
class Linearization(Columns):
    """The state at which a tangent is taken; one column a batch member."""

    u: torch.Tensor
    """Displacements [mm], shape (n, 3, b), in the precision of the linear solve."""
    conditions: Conditions
    """In the same precision."""
    contacts: tuple[ContactTangent, ...]
    """Stiffness of each contact."""
    dilatation: torch.Tensor | None
    """`Elasticity.dilatation` at ``u``."""


class TangentStiffness:
    """K as an operator. It holds what never changes; the state is an argument."""

    def __init__(self, body: Elasticity, surfaces: Sequence[ContactSurface]) -> None:
        """Bind a body and its contact surfaces."""
        self.body, self.surfaces = body, tuple(surfaces)

    def at(self, u: torch.Tensor, conditions: Conditions, contacts: Sequence[ContactTangent]) -> Linearization:
        """Return the state that `add_product` takes; ``u`` and ``conditions`` in the precision of the solve."""
        own = conditions.to(u.dtype)
        return Linearization(u, own, tuple(contacts), self.body.dilatation(u, own))

    def add_product(self, at: Linearization, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add K p [N] to ``result``; both of shape (n, 3, b) and of one precision, held nodes included."""
        self.body.tangent_product(at.u, p, at.conditions, result, at.dilatation)
        for surface, contact in zip(self.surfaces, at.contacts, strict=True):
            surface.add_product(contact, p, result)
