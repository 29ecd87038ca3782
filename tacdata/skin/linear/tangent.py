"""The tangent stiffness K of body and contacts at one state, by its products with fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.member.columns import Columns
from tacdata.skin.member.conditions import Conditions

_FEW = 3
"""Members for which a tangent is prepared, at the least: eight cost as much as one."""


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
    """`Elasticity.dilatation` at ``u``; None where the tangent is prepared."""
    member: torch.Tensor | None = None
    """Which members of the batch these are, shape (b,); None where the tangent is not prepared."""


class TangentStiffness:
    """K as an operator.

    Body and surfaces never change; the state is an argument. On a CPU it also keeps a cache: the tangents that were
    prepared for members of the present batch (`PreparedTangent`), which `keep` and `forget` follow.
    """

    def __init__(self, body: Elasticity, surfaces: Sequence[ContactSurface]) -> None:
        """Bind a body and its contact surfaces."""
        self.body, self.surfaces, self._prepared = body, tuple(surfaces), body.prepared()

    def at(
        self,
        u: torch.Tensor,
        conditions: Conditions,
        contacts: Sequence[ContactTangent],
        mask: torch.Tensor | None = None,
    ) -> Linearization:
        """Return the state that `add_product` takes.

        ``u`` has the precision of the solve. The tangent is prepared for members in ``mask``, shape (b,), bool.
        """
        material = conditions.to(u.dtype)
        if self._prepared and mask is not None and len(members := mask.nonzero()[:, 0]) >= _FEW:
            self._prepared.update(u, material, members)
            return Linearization(u, material, tuple(contacts), None, torch.arange(u.shape[2]))
        return Linearization(u, material, tuple(contacts), self.body.dilatation(u, material))

    def add_product(self, at: Linearization, p: torch.Tensor, result: torch.Tensor) -> None:
        """Add K p [N] to ``result``; both of shape (n, 3, b) and of one precision, held nodes included."""
        if self._prepared and at.member is not None:
            self._prepared.add_product(p, at.member, result)
        else:
            self.body.tangent_product(at.u, p, at.conditions, result, at.dilatation)
        for surface, contact in zip(self.surfaces, at.contacts, strict=True):
            surface.add_product(contact, p, result)

    def keep(self, which: torch.Tensor) -> None:
        """Keep only some members, by index, shape (k,)."""
        if self._prepared:
            self._prepared.keep(which)

    def forget(self, which: torch.Tensor) -> None:
        """Reset members, by index."""
        if self._prepared:
            self._prepared.forget(which)
