"""The preconditioner of the tangent: rest stiffness plus the present contact stiffness, by the Woodbury identity.

    (K0 + C S C^T)^-1 = K0^-1 (1 - C (I + S G)^-1 S C^T K0^-1)

C picks the degrees of freedom in contact, S is the contact stiffness on them, and G = C^T K0^-1 C their compliance.
Stiff contact, which K0 alone knows nothing of, then costs no conjugate-gradient iterations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear.contact_transfer import DenseTransfer, contact_transfer
from tacdata.skin.linear.coupled_dofs import coupling
from tacdata.skin.linear.rest_stiffness import RestSolver

_GROUP = 128
"""Members whose small systems are padded to one size: those of similar size go together."""

_STEP = 256
"""Rows by which the room for members' touched degrees of freedom grows."""

_STALE = {"cpu": 0.1, "cuda": 0.3}
"""Change of a member's contact stiffness, over its norm, from which on its share is prepared anew [1]; on a GPU that
costs more than the conjugate gradients it saves."""

_WEAK = {"cpu": 0.0, "cuda": 0.1}
"""Contact stiffness of a degree of freedom times its compliance in the free body from which on a share knows it [1]. At
the contact's edge are many that hardly feel it: conjugate gradients bear them, while a GPU's inversions grow with the
cube of their number."""


_Contacts = list[tuple[ContactSurface, ContactTangent]]
"""Each contact surface with its present stiffness."""


@dataclass(frozen=True)
class Share:
    """The contact's share as tensors, a row a member, for `tacdata.skin.linear.cuda_cg`."""

    softness: torch.Tensor
    """Nominal modulus over the member's [1], shape (b,), float32."""
    which: torch.Tensor
    """Numbers among the loadable degrees of freedom that members touch, shape (b, k), int64."""
    own: torch.Tensor
    """How many of them are each member's own, shape (b,), int32."""
    transfer: torch.Tensor
    """Contact forces against displacements of the free body [N/mm], symmetric, shape (b, k or more, same)."""

    @classmethod
    def none(cls, device: torch.device) -> Share:
        """Return that of no member."""
        nothing = torch.empty(0, 0, dtype=torch.int64, device=device)
        return cls(torch.empty(0), nothing, torch.empty(0), torch.empty(0, 0, 0, device=device))

    @property
    def place(self) -> tuple[object, ...]:
        """Where the large tensors are: the same while they are the same."""
        return self.which.data_ptr(), self.which.shape, self.transfer.data_ptr(), self.transfer.shape


class ContactPreconditioner:
    """Approximate inverse of the tangent for every member of a batch."""

    def __init__(
        self, rest: RestSolver, surfaces: Sequence[ContactSurface], loadable: torch.Tensor, size: int, modulus: float
    ) -> None:
        """Bind K0^-1 and the contact surfaces.

        Args:
            rest: K0^-1 of the nominal material.
            surfaces: Whose stiffness is added.
            loadable: Degrees of freedom that contact may load, shape (m,), int64.
            size: Number of degrees of freedom, 3n.
            modulus: Young's modulus [MPa] of the nominal material.
        """
        self.rest: Any = rest
        """K0^-1, as it was given."""
        self._rest, self._surfaces, self._modulus, self._size = rest, tuple(surfaces), modulus, size
        count, device = len(loadable), loadable.device
        self._dof = torch.cat([loadable, torch.tensor([size], device=device)])
        number = torch.full((size,), count, dtype=torch.int64, device=device)
        number[loadable] = torch.arange(count, device=device)
        axes = torch.arange(3, device=device)
        self._numbers = [number[(3 * c.faces.long()[:, :, None] + axes).reshape(-1, 18)] for c in surfaces]
        """Number among the loadable of each face's degrees of freedom, shape (f, 18)."""
        self._first, self._reach = coupling([numbers.cpu().numpy() for numbers in self._numbers], count)
        self._scale = torch.empty(0)
        self._transfer = contact_transfer(0, "cpu")
        self._which = torch.empty(0, 0, dtype=torch.int64, device=device)
        """Numbers among the loadable degrees of freedom that each member touches; the count of all stands for none."""
        self._own = torch.empty(0)
        """Compliance of every loadable degree of freedom with itself [mm/N], shape (m + 1,), once asked for."""
        self._prepared: list[torch.Tensor] = []
        """Contact stiffness that each member's share was prepared from, by contact."""

    def update(self, contacts: Sequence[ContactTangent], modulus: torch.Tensor) -> None:
        """Prepare for the present contact stiffness.

        A member whose stiffness has hardly changed keeps its share: conjugate gradients bear the difference.

        Args:
            contacts: Stiffness of each contact.
            modulus: Young's modulus of each member [MPa], shape (b,).
        """
        self._scale = (self._modulus / modulus).to(torch.float32)
        batch, count, device = len(modulus), len(self._dof) - 1, modulus.device
        both = list(zip(self._surfaces, contacts, strict=True))
        stale = self._stale([surface.weighted_stiffness(contact) for surface, contact in both], batch)
        if not bool(stale.any()):
            return
        touched = torch.zeros(batch, count + 1, dtype=torch.bool, device=device)
        pairs = [(contact.touched & stale).nonzero().unbind(dim=1) for contact in contacts]
        for numbers, (face, member) in zip(self._numbers, pairs, strict=True):
            touched[member[:, None], numbers[face]] = True
        touched[:, count] = False
        if _WEAK[device.type]:
            touched &= self._weight(both, pairs, batch) > _WEAK[device.type]
        members = stale.nonzero()[:, 0]
        counts, order = touched[members].sum(dim=1).sort()
        members = members[order]
        leads = touched[members, : self._first].sum(dim=1)
        sizes, leads = torch.stack([counts, leads]).tolist()
        self._widen(sizes[-1])
        for start in range(0, len(sizes), _GROUP):
            member = members[start : start + _GROUP]
            most = sizes[min(start + _GROUP, len(sizes)) - 1]
            self._which[member] = count
            self._prepare(member, most, max(leads[start : start + _GROUP]), touched[member], both, pairs)

    def _weight(self, both: _Contacts, pairs: list[tuple[torch.Tensor, ...]], batch: int) -> torch.Tensor:
        """Return the contact stiffness of degrees of freedom times their compliance [1], shape (b, count + 1)."""
        count, device = len(self._dof) - 1, self._dof.device
        if not len(self._own):
            own = self._rest.compliance(torch.arange(count, device=device)[:, None])[:, 0, 0]
            self._own = torch.cat([own, torch.zeros(1, device=device)])
        weight = torch.zeros(batch, count + 1, device=device)
        for (surface, contact), numbers, (face, member) in zip(both, self._numbers, pairs, strict=True):
            flat = member[:, None] * (count + 1) + numbers[face]
            weight.view(-1).scatter_add_(0, flat.flatten(), surface.face_diagonal(contact, face, member).flatten())
        return weight * self._own * self._scale[:, None]

    def _stale(self, stiffness: list[torch.Tensor], batch: int) -> torch.Tensor:
        """Return which members' share no longer fits, shape (b,), and remember what they are prepared from now."""
        device = self._dof.device
        if len(self._which) != batch:
            self._transfer = contact_transfer(batch, device.type if device.type == "cpu" else str(device))
            self._which = torch.full((batch, 0), len(self._dof) - 1, dtype=torch.int64, device=device)
            self._prepared = [torch.full_like(now, torch.nan) for now in stiffness]
        change, size = torch.zeros(batch, device=device), torch.zeros(batch, device=device)
        for now, before in zip(stiffness, self._prepared, strict=True):
            change += (now - before).square().flatten(0, -2).sum(dim=0)
            size += now.square().flatten(0, -2).sum(dim=0)
        # What was never prepared is not a number, and so not below.
        stale = ~(change <= _STALE[device.type] ** 2 * size)
        for now, before in zip(stiffness, self._prepared, strict=True):
            before.copy_(torch.where(stale, now, before))
        return stale

    def _widen(self, most: int) -> None:
        """Make room for members that touch ``most`` degrees of freedom."""
        if most > self._which.shape[1]:
            # In steps, as what is recorded of a GPU's iterations must be recorded anew.
            more = -(-most // _STEP) * _STEP - self._which.shape[1]
            self._which = torch.nn.functional.pad(self._which, (0, more), value=len(self._dof) - 1)

    def _prepare(
        self, member: torch.Tensor, most: int, lead: int, touched: torch.Tensor, both: _Contacts,
        pairs: list[tuple[torch.Tensor, ...]],
    ) -> None:
        """Prepare members that touch at most ``most`` degrees of freedom, ``lead`` of them among the `_first`;
        ``touched``: shape (g, count + 1)."""
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
        for (surface, contact), numbers, (face, owner) in zip(both, self._numbers, pairs, strict=True):
            mine = row_of[owner] >= 0
            face, owner = face[mine], owner[mine]
            row = row_of[owner]
            place = slot[row[:, None], numbers[face]]
            # By flat index: sums over several indices are sorted first, which takes a GPU milliseconds.
            flat = (row[:, None, None] * (most + 1) + place[:, :, None]) * (most + 1) + place[:, None, :]
            stiffness.view(-1).scatter_add_(0, flat.flatten(), surface.face_stiffness(contact, face, owner).flatten())
        compliance = self._rest.compliance(which) * self._scale[member][:, None, None]
        # A slot that stands for nothing must not make the compliance singular.
        compliance.diagonal(dim1=1, dim2=2).add_((which == count).to(torch.float32))
        self._which[member, :most] = which
        whole = stiffness[:, :most, :most].contiguous()
        self._transfer.put(member, whole, compliance, lead, self._reach)

    def share(self) -> Share:
        """Return what `update` prepared, on a GPU."""
        if not isinstance(self._transfer, DenseTransfer):
            raise TypeError("the CPU's shares are factors, not tensors")
        own = (self._which < len(self._dof) - 1).sum(dim=1).to(torch.int32)
        return Share(self._scale, self._which, own, self._transfer.matrix)

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return the approximate solution for residuals of the first b members, shape (n, 3, b), float32."""
        r = residual.reshape(self._size, -1)
        count = r.shape[1]
        which, scale = self._which[:count], self._scale[:count]
        if which.shape[1]:
            z = torch.nn.functional.pad(self._rest.loadable(r) * scale, (0, 0, 0, 1))
            columns = torch.arange(count, device=r.device)[:, None]
            y = self._transfer.times(z[which, columns])
            r = torch.cat([r, torch.zeros_like(r[:1])])
            # A member's degrees of freedom are all different, the one that stands for none aside.
            r.scatter_add_(0, self._dof[which].T, -y.T)
            r = r[:-1]
        return (self._rest.apply(r) * scale).reshape(residual.shape)
