"""The preconditioner of the tangent: rest stiffness plus the present contact stiffness, by the Woodbury identity.

(K0 + C S C^T)^-1 = K0^-1 (1 - C (I + S G)^-1 S C^T K0^-1), with S the contact stiffness on the degrees of freedom that
C picks and G = C^T K0^-1 C their compliance. Stiff contact, which K0 alone knows nothing of, then costs no
conjugate-gradient iterations.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from tacdata.skin.contact import Contact
from tacdata.skin.rest import RestSolver
from tacdata.skin.transfer import Transfer, contact_transfer

_GROUP = 32
"""Members whose small systems are padded to one size: those of similar size go together."""


@dataclass(frozen=True)
class _Group:
    """Some members' contact."""

    member: torch.Tensor
    """Their columns, shape (g,)."""
    which: torch.Tensor
    """Numbers among the loadable degrees of freedom, shape (g, m); the count of all stands for none."""
    transfer: Transfer
    """(I + S G)^-1 S [N/mm]."""


class ContactPreconditioner:
    """Approximate inverse of the tangent for every member of a batch."""

    def __init__(
        self, rest: RestSolver, contacts: list[Contact], loadable: torch.Tensor, size: int, modulus: float
    ) -> None:
        """Bind K0^-1 and the contacts.

        Args:
            rest: K0^-1 of the nominal material.
            contacts: Whose stiffness is added.
            loadable: Degrees of freedom that contact may load, shape (m,), int64.
            size: Number of degrees of freedom, 3n.
            modulus: Young's modulus [MPa] of the nominal material.
        """
        self._rest, self._contacts, self._modulus, self._size = rest, contacts, modulus, size
        count, device = len(loadable), loadable.device
        self._dof = torch.cat([loadable, torch.tensor([size], device=device)])
        number = torch.full((size,), count, dtype=torch.int64, device=device)
        number[loadable] = torch.arange(count, device=device)
        axes = torch.arange(3, device=device)
        self._numbers = [number[(3 * c.faces.long()[:, :, None] + axes).reshape(-1, 18)] for c in contacts]
        """Number among the loadable of each face's degrees of freedom, shape (f, 18)."""
        self._scale = torch.empty(0)
        self._groups: list[_Group] = []

    def update(self, modulus: torch.Tensor) -> None:
        """Take the contact stiffness that was evaluated last; ``modulus``: each member's [MPa], shape (b,)."""
        self._scale = (self._modulus / modulus).to(torch.float32)
        batch, count, device = len(modulus), len(self._dof) - 1, modulus.device
        touched = torch.zeros(batch, count + 1, dtype=torch.bool, device=device)
        pairs = [contact.touched.nonzero().unbind(dim=1) for contact in self._contacts]
        for numbers, (face, member) in zip(self._numbers, pairs, strict=True):
            touched[member[:, None], numbers[face]] = True
        touched[:, count] = False
        counts, order = touched.sum(dim=1).sort()
        largest = counts.cpu().tolist()
        self._groups = []
        for start in range(0, batch, _GROUP):
            member = order[start : start + _GROUP]
            most = largest[min(start + _GROUP, batch) - 1]
            if most:
                self._groups.append(self._group(member, most, touched[member], pairs))

    def _group(
        self, member: torch.Tensor, most: int, touched: torch.Tensor, pairs: list[tuple[torch.Tensor, ...]]
    ) -> _Group:
        """Prepare members that touch at most ``most`` degrees of freedom; ``touched``: shape (g, count + 1)."""
        count, device, size = len(self._dof) - 1, member.device, len(member)
        # Each member's own slots: its touched degrees of freedom in order; one spare slot takes what belongs to none.
        slot = torch.where(touched, torch.cumsum(touched, dim=1) - 1, most)
        which = torch.full((size, most + 1), count, dtype=torch.int64, device=device)
        row, number = touched.nonzero(as_tuple=True)
        which[row, slot[row, number]] = number
        which = which[:, :most].contiguous()
        row_of = torch.full((len(self._scale),), -1, dtype=torch.int64, device=device)
        row_of[member] = torch.arange(size, device=device)
        stiffness = torch.zeros(size, most + 1, most + 1, dtype=torch.float32, device=device)
        for contact, numbers, (face, owner) in zip(self._contacts, self._numbers, pairs, strict=True):
            mine = row_of[owner] >= 0
            face, owner = face[mine], owner[mine]
            row = row_of[owner]
            place = slot[row[:, None], numbers[face]]
            stiffness.index_put_(
                (row[:, None, None], place[:, :, None], place[:, None, :]), contact.face_stiffness(face, owner),
                accumulate=True,
            )
        compliance = self._rest.compliance(which) * self._scale[member][:, None, None]
        # A slot that stands for nothing must not make the compliance singular.
        compliance.diagonal(dim1=1, dim2=2).add_((which == count).to(torch.float32))
        return _Group(member, which, contact_transfer(stiffness[:, :most, :most], compliance))

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return the approximate solution for residuals of shape (n, 3, b), float32."""
        r = residual.reshape(self._size, -1)
        if self._groups:
            z = torch.nn.functional.pad(self._rest.loadable(r) * self._scale, (0, 0, 0, 1))
            r = torch.cat([r, torch.zeros_like(r[:1])])
            for group in self._groups:
                own = z[group.which, group.member[:, None]]
                y = group.transfer.times(own)
                # A member's degrees of freedom are all different, the one that stands for none aside.
                r.index_put_((self._dof[group.which], group.member[:, None].expand_as(y)), -y, accumulate=True)
            r = r[:-1]
        return (self._rest.apply(r) * self._scale).reshape(residual.shape)
