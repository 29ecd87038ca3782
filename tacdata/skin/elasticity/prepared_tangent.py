"""The tangent of a body with averaged volume changes, prepared for a CPU.

Conjugate gradients multiply one tangent with some six fields. So the law is asked once for its moduli. A product is
linear algebra then. Eight members go at a time. A CPU does that in one instruction. Most of the skin moves little in
a Newton step. Its moduli stay.

On a GPU memory costs. Moduli take much of it. So it evaluates the law again.
"""

from __future__ import annotations

from typing import Any

import torch

from tacdata.skin.elasticity.averaged_volume import CORRECTIONS, AveragedVolume
from tacdata.skin.elasticity.element_functions import constant_data
from tacdata.skin.elasticity.point_moduli import LANES, NUMBERS, moduli_kernel, product_kernels
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.warp_runtime import wp

_MOVED = 0.003
"""Change of an entry of F's cofactor up to which a point keeps its moduli [1]."""


class PreparedTangent:
    """K of the members of one batch."""

    def __init__(self, averaged: AveragedVolume, dtype: torch.dtype = torch.float32) -> None:
        """Bind a body."""
        self._body, self._dtype, self._real = averaged, dtype, REAL[dtype]
        self._begin(0)

    def keep(self, which: torch.Tensor) -> None:
        """Let go of all members but some, by index, shape (k,)."""
        if len(self._lane):
            self._lane = self._lane[which]

    def forget(self, which: torch.Tensor) -> None:
        """Reset members, by index."""
        if len(self._lane):
            # The last number is an entry of the cofactor: an infinite one counts as moved at the next update.
            self._values[:, :, -1, self._lane[which]] = torch.inf

    def update(self, u: torch.Tensor, conditions: Conditions, member: torch.Tensor) -> None:
        """Prepare the tangent of some members.

        Args:
            u: Displacements of all [mm], shape (n, 3, b).
            conditions: Conditions of all, in one precision with ``u``.
            member: Which are to be prepared, by index, shape (k,).
        """
        if u.shape[2] != len(self._lane):
            self._begin(u.shape[2])
        lane = self._lane[member]
        u, conditions = u.index_select(2, member), conditions.take(member)
        constants = filled(
            constant_data(self._real), law=conditions.law, modulus=conditions.modulus, thickness=conditions.thickness
        )
        self._launch(
            moduli_kernel(self._body.law, self._real),
            self._body.elements,
            u.shape[2],
            u,
            self._body.data[self._dtype],
            constants,
            self._body.dilatation(u, conditions),
            lane.to(torch.int32),
            _MOVED,
            self._values,
            self._bulk,
        )
        self._thickness[lane] = conditions.thickness

    def update_one(self, u: torch.Tensor, conditions: Conditions, fields: int) -> None:
        """Prepare the tangent of one state for products with so many fields at a time.

        Args:
            u: Displacements [mm], shape (n, 3, 1).
            conditions: Conditions of one member, in one precision with ``u``.
            fields: How many; `add_product` takes the first of them as members 0, 1, ...
        """
        self._begin(1)
        self.update(u, conditions, self._lane)
        blocks = -(-fields // LANES)
        # Every lane is a copy of the one state, so that its fields are multiplied eight at a time.
        self._values = self._values[..., :1].expand(-1, -1, -1, LANES * blocks).contiguous()
        self._bulk, self._thickness = (
            values[:1].expand(LANES * blocks).contiguous() for values in (self._bulk, self._thickness)
        )
        self._lane = torch.arange(fields)

    def add_product(self, p: torch.Tensor, member: torch.Tensor, result: torch.Tensor) -> None:
        """Add K p [N] of members, by index, shape (k,), to ``result``; both of shape (n, 3, k)."""
        lane, kernels, body = self._lane[member], product_kernels(self._real), self._body
        block, place = torch.unique(torch.div(lane, LANES, rounding_mode="floor"), return_inverse=True)
        place, count = LANES * place + lane % LANES, len(block)
        lanes = (LANES * block[:, None] + torch.arange(LANES)).ravel()
        # A vector of lanes is multiplied as a whole; members that are not asked for get zeros.
        wide = torch.zeros(*p.shape[:2], len(lanes), dtype=p.dtype)
        wide[:, :, place] = p
        direction, moduli, mesh = self._lanes(wide), self._lanes(self._values), body.data[self._dtype]
        sums, block = torch.zeros(body.corners, len(lanes), dtype=p.dtype), block.to(torch.int32)
        self._launch(kernels.swelling, body.elements, count, direction, mesh, moduli, block, self._lanes(sums))
        average, thickness = torch.zeros_like(sums), self._lanes(self._thickness[lanes])
        for _ in range(CORRECTIONS + 1):
            corrected = torch.empty_like(sums)
            self._launch(
                kernels.correct,
                body.corners,
                count,
                *body.pattern,
                *body.mass[self._dtype],
                thickness,
                *map(self._lanes, (sums, average, corrected)),
            )
            average = corrected
        pressure, total = average * self._bulk[lanes], torch.zeros_like(wide)
        self._launch(
            kernels.product, body.elements, count, direction, mesh, moduli, block, *map(self._lanes, (pressure, total))
        )
        result += total[:, :, place]

    def _begin(self, count: int) -> None:
        """Make room for so many members."""
        lanes = -(-count // LANES) * LANES
        self._values = torch.full((self._body.elements, 4, NUMBERS, lanes), torch.inf, dtype=self._dtype)
        self._bulk, self._thickness = torch.zeros(lanes, dtype=self._dtype), torch.ones(lanes, dtype=self._dtype)
        self._lane = torch.arange(count)

    def _lanes(self, values: torch.Tensor) -> Any:
        """Return a tensor as an array of vectors along its last axis."""
        shape = *values.shape[:-1], -1, LANES
        return wp.from_torch(values.view(shape), dtype=wp.types.vector(LANES, self._real), return_ctype=True)

    def _launch(self, kernel: Any, rows: int, columns: int, *values: Any) -> None:
        wp.launch(kernel, dim=(rows, columns), inputs=[*map(argument, values)], device="cpu")
