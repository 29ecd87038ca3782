"""The active nodes' constraints of every batch member: the mortar rows that each joins, and their compliance.

Tensors keep their place from one Newton step to the next, and grow with the number of constraints: so their readers can
be recorded as a CUDA graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear import constraint_kernels as kernels
from tacdata.skin.linear.rest_stiffness import RestSolver
from tacdata.skin.member.warp_arrays import argument, filled
from tacdata.warp_runtime import wp

_TURNED, _SOFTENED = 0.02, 0.3
"""Relative change of a direction [1] and of its compliance [1], up to which members keep the constraints that
they had: their compliance is known. It is the lag of one Newton step, and small against the error of the steps."""


class _Rows:
    """Room for constraints of members; zeros beyond a member's own."""

    def __init__(self, members: int, capacity: int, device: torch.device | str) -> None:
        self.first = torch.zeros(members, capacity, dtype=torch.int32, device=device)
        """First mortar row of each constraint, shape (b, a)."""
        self.direction = torch.zeros(members, capacity, 3, device=device)
        """Weights of this entry and the next two [1], shape (b, a, 3)."""
        self.give = torch.zeros(members, capacity, 2, device=device)
        """By how much it gives way, alone, and with the one before [mm/N], shape (b, a, 2)."""
        self.own = torch.zeros(members, dtype=torch.int32, device=device)
        """Number of constraints, shape (b,)."""
        self.scale = torch.zeros(members, device=device)
        """Nominal modulus over the member's, shape (b,)."""
        self.data = filled(kernels.RowData, first=self.first, direction=self.direction, give=self.give, own=self.own)
        """The same, as kernels take it."""

    def differ(self, new: _Rows) -> torch.Tensor:
        """Return which of the first members have other constraints in ``new``, shape (b,), bool."""
        count = len(new.own)
        # A factor is made again only if constraints changed by more than a preconditioner notices.
        rotated = (self.direction[:count] - new.direction).abs().amax(dim=(1, 2)) > _TURNED
        give = self.give[:count]
        limit = _SOFTENED * torch.maximum(give[:, :, :1], new.give[:, :, :1])
        softened = ((give - new.give).abs() > limit).any(dim=2).any(dim=1)
        replaced = (self.first[:count] != new.first).any(dim=1) | (self.own[:count] != new.own)
        return rotated | softened | replaced | (self.scale[:count] != new.scale)

    def put(self, which: torch.Tensor, new: _Rows) -> None:
        """Replace members, by index, by those of ``new``."""
        for name in ("first", "direction", "give", "own", "scale"):
            getattr(self, name).index_copy_(0, which, getattr(new, name)[which])


class ActiveRows:
    """Normal directions, and with friction two tangents, of each member's active nodes; a constraint each."""

    def __init__(self, surfaces: Sequence[ContactSurface], solver: RestSolver, step: int) -> None:
        """Bind the surfaces, whose mortar rows those of ``solver`` are; room grows by multiples of ``step``."""
        self._surfaces, self._rest, self._step = tuple(surfaces), solver, step
        self._base, base = [], 0
        for surface in surfaces:
            self._base.append(base)
            base += surface.count * (1 if surface.flat else 3)
        self.count = base
        """Number of mortar rows."""
        self._held, self._table = _Rows(0, 0, "cpu"), torch.empty(0)
        self.sizes: list[int] = []
        """Number of constraints of each member."""
        self.used = torch.zeros(base, 0, dtype=torch.bool)
        """Mortar rows that the constraints of each member join, shape (m, b), bool."""
        self._slots: list[torch.Tensor] = []
        self._active: list[torch.Tensor] = []

    @property
    def most(self) -> int:
        """Room for so many constraints of a member."""
        return self._held.first.shape[1]

    @property
    def data(self) -> Any:
        """The constraints as kernels take them."""
        return self._held.data

    @property
    def place(self) -> tuple[int, ...]:
        """Where they are: the same while the tensors stay."""
        return self._held.first.data_ptr(), *self._held.first.shape

    def update(self, contacts: Sequence[ContactTangent], scale: torch.Tensor) -> list[int]:
        """Describe the constraints of the present active nodes.

        Args:
            contacts: Of each surface.
            scale: Nominal modulus over each member's [1], shape (b,), float32.

        Returns:
            Members whose constraints are others than before.
        """
        self._active, self._slots, count = [contact.active for contact in contacts], [], torch.zeros_like(scale).long()
        for surface, active in zip(self._surfaces, self._active, strict=True):
            directions = _directions(surface)
            # Sums along rows of memory: across them they take ten times as long on a GPU.
            place = active.T.contiguous().cumsum(dim=1).T
            self._slots.append(count + directions * (place - 1))
            count = count + directions * place[-1]
        self.sizes = count.tolist()
        capacity = -(-max(self.sizes) // self._step) * self._step
        rows, device = self._held, scale.device
        if len(scale) > len(rows.own) or capacity > self.most or rows.own.device != device:
            # Room never shrinks: tensors stay where recorded CUDA graphs expect them.
            self._held = rows = _Rows(max(len(scale), len(rows.own)), max(capacity, self.most), device)
        every = zip(self._surfaces, self._active, strict=True)
        self.used = torch.cat([active.repeat_interleave(1 if surface.flat else 3, dim=0) for surface, active in every])
        self._table = self._rest.table(self.used.any(dim=1))
        new = _Rows(len(scale), self.most, device)
        new.own.copy_(count)
        new.scale.copy_(scale)
        for surface, contact, base, slot in zip(self._surfaces, contacts, self._base, self._slots, strict=True):
            flags = int(surface.flat), int(_directions(surface) == 3), base
            self.launch(
                kernels.describe,
                tuple(slot.shape),
                contact.active,
                slot,
                contact.normal,
                contact.friction,
                *flags,
                scale,
                self._table,
                new.data,
            )
        if not self.most:
            return []
        which = rows.differ(new).nonzero()[:, 0]
        rows.put(which, new)
        return which.tolist()

    def compliance(self, member: torch.Tensor, room: torch.Tensor) -> None:
        """Write the compliance of the constraints of some members [mm/N], its lower triangle.

        Args:
            member: Indices, shape (g,), int64.
            room: Receives them, bordered by a unit matrix, shape (g, a, a), float32.
        """
        rows = self._held
        dim = len(room), -(-room.shape[1] // int(kernels.STRIP)), room.shape[2]
        self.launch(kernels.assemble, dim, member, rows.data, rows.scale, self._table, room)

    def wanted(self, gaps: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return changes of mean gaps [mm], by contact, shape (s, b), as values of the constraints, shape (b, a)."""
        values = torch.zeros(self.most + 1, len(self.sizes), device=self._held.own.device)
        for active, slot, gap in zip(self._active, self._slots, gaps, strict=True):
            # Nodes that are not active write to an additional last row, which is dropped.
            values.scatter_(0, torch.where(active, slot, self.most), gap.to(torch.float32))
        return values[:-1].T.contiguous()

    def normal_forces(self, y: torch.Tensor) -> list[torch.Tensor]:
        """Return the normal forces [N] among those of the constraints, shape (b, a), by contact, shape (s, b)."""
        if not self.most:
            return [torch.zeros(active.shape, dtype=torch.float64, device=y.device) for active in self._active]
        return [
            # Slots before a member's first active node are negative; their values are replaced by 0.
            torch.where(active, y.T.gather(0, slot.clamp_min(0)).to(torch.float64), 0.0)
            for active, slot in zip(self._active, self._slots, strict=True)
        ]

    def launch(self, kernel: Any, dim: tuple[int, ...], *values: object) -> None:
        """Run a kernel of `constraint_kernels`."""
        wp.launch(kernel, dim=dim, inputs=[*map(argument, values)], device=str(self._held.own.device))


def _directions(surface: ContactSurface) -> int:
    return 3 if surface.rough and not surface.flat else 1
