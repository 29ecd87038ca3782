"""The active nodes' constraints of every batch member: the mortar rows that each joins, and their compliance.

Tensors keep their place from one Newton step to the next, and grow where more constraints come: so what reads them can
be recorded as a CUDA graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
import warp as wp

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear import constraint_kernels as kernels
from tacdata.skin.linear.rest_stiffness import RestSolver
from tacdata.skin.member.warp_arrays import argument, filled


class ActiveRows:
    """Normal directions, and with friction two tangents, of each member's active nodes; a constraint each."""

    def __init__(self, surfaces: Sequence[ContactSurface], rest: RestSolver, step: int) -> None:
        """Bind the surfaces, whose mortar rows those of ``rest`` are; room grows by multiples of ``step``."""
        self._surfaces, self._rest, self._step = tuple(surfaces), rest, step
        self._base, base = [], 0
        for surface in surfaces:
            self._base.append(base)
            base += surface.count * (1 if surface.flat else 3)
        self.count = base
        """Number of mortar rows."""
        self._room(0, 0, "cpu")
        self.sizes: list[int] = []
        """Number of constraints of each member."""
        self._slots: list[torch.Tensor] = []
        self._active: list[torch.Tensor] = []

    def _room(self, members: int, most: int, device: torch.device | str) -> None:
        self.first = torch.zeros(members, most, dtype=torch.int32, device=device)
        """First mortar row of each constraint, shape (b, a)."""
        self.direction = torch.zeros(members, most, 3, device=device)
        """What it takes of this and the two that follow [1], shape (b, a, 3)."""
        self.give = torch.zeros(members, most, 2, device=device)
        """By how much it gives way, alone, and with the one before [mm/N], shape (b, a, 2)."""
        self.own = torch.zeros(members, dtype=torch.int32, device=device)
        """Number of constraints, shape (b,)."""
        self.data = filled(
            kernels.RowData, first=self.first, direction=self.direction, give=self.give, own=self.own
        )
        """The same, as kernels take it."""

    @property
    def most(self) -> int:
        """Room for so many constraints of a member."""
        return self.first.shape[1]

    def update(self, contacts: Sequence[ContactTangent], scale: torch.Tensor) -> torch.Tensor:
        """Describe the constraints of the present active nodes.

        Args:
            contacts: Of each surface.
            scale: Nominal modulus over each member's [1], shape (b,), float32.

        Returns:
            M K0^-1 M^T [mm/N], in which the rows of these constraints are known.
        """
        self._active, self._slots, count = [contact.active for contact in contacts], [], torch.zeros_like(scale).long()
        for surface, active in zip(self._surfaces, self._active, strict=True):
            directions = _directions(surface)
            place = active.cumsum(dim=0)
            self._slots.append(count + directions * (place - 1))
            count = count + directions * place[-1]
        self.sizes = count.tolist()
        most = -(-max(self.sizes) // self._step) * self._step
        if len(scale) != len(self.own) or most > self.most or self.own.device != scale.device:
            self._room(len(scale), max(most, self.most), scale.device)
        self.own.copy_(count)
        table = self._rest.table(self._used())
        for surface, contact, base, slot in zip(self._surfaces, contacts, self._base, self._slots, strict=True):
            flags = int(surface.flat), int(_directions(surface) == 3), base
            self.launch(
                kernels.describe, tuple(slot.shape), contact.active, slot, contact.normal, contact.friction, *flags,
                scale, table, self.data,
            )
        return table

    def _used(self) -> torch.Tensor:
        """Return which mortar rows some member's constraints join, shape (m,), bool."""
        parts = [
            active.any(dim=1).repeat_interleave(1 if surface.flat else 3)
            for surface, active in zip(self._surfaces, self._active, strict=True)
        ]
        return torch.cat(parts)

    def compliance(self, member: torch.Tensor, scale: torch.Tensor, table: torch.Tensor, room: torch.Tensor) -> None:
        """Write the compliance of the constraints of some members [mm/N], its lower triangle.

        Args:
            member: Indices, shape (g,), int64.
            scale: As `update` takes it.
            table: As `update` returned it.
            room: Receives them, bordered by a unit matrix, shape (g, a, a), float32.
        """
        self.launch(kernels.assemble, tuple(room.shape), member, self.data, scale, table, room)

    def wanted(self, gaps: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return changes of mean gaps [mm], by contact, shape (s, b), as values of the constraints, shape (b, a)."""
        values = torch.zeros(self.most + 1, len(self.own), device=self.own.device)
        for active, slot, gap in zip(self._active, self._slots, gaps, strict=True):
            values.scatter_(0, torch.where(active, slot, self.most), gap.to(torch.float32))
        return values[:-1].T.contiguous()

    def normal_forces(self, y: torch.Tensor) -> list[torch.Tensor]:
        """Return the normal forces [N] among those of the constraints, shape (b, a), by contact, shape (s, b)."""
        if not self.most:
            return [torch.zeros(active.shape, dtype=torch.float64, device=y.device) for active in self._active]
        return [
            torch.where(active, y.T.gather(0, slot.clamp_min(0)).to(torch.float64), 0.0)
            for active, slot in zip(self._active, self._slots, strict=True)
        ]

    def launch(self, kernel: Any, dim: tuple[int, ...], *values: object) -> None:
        """Run a kernel of `constraint_kernels`."""
        wp.launch(kernel, dim=dim, inputs=[*map(argument, values)], device=str(self.own.device))


def _directions(surface: ContactSurface) -> int:
    return 3 if surface.rough and not surface.flat else 1
