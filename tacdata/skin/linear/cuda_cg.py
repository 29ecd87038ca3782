"""Projected conjugate gradients on a GPU: those of `projected_cg`, kernels fused, in a batch that shrinks.

Members need very different numbers of iterations. Those that are done leave the batch once enough of them are, so that
the others do not pay for them. Residuals are multiplied with the rest state's inverse in half precision. So forces of
the constraints, which would drown the rest, are taken off the residual for good (Gould, Hribar and Nocedal, section 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
import warp as wp

from tacdata.skin.linear import constraint_kernels
from tacdata.skin.linear import cuda_cg_kernels as kernels
from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.constraint_solvers import InvertedCompliance
from tacdata.skin.linear.cuda_cg_columns import ActiveColumns
from tacdata.skin.linear.projected_cg import Stopping
from tacdata.skin.linear.rest_stiffness import DenseRest
from tacdata.skin.linear.tangent import Linearization, TangentStiffness
from tacdata.skin.member.warp_arrays import argument

_ROOM = 256.0
"""To which residuals are scaled for half precision: they may grow as much again."""

_SHRINK, _COLUMNS, _WIDTHS = 0.85, 32, 8
"""Share of a batch that may be left before it shrinks [1], to a multiple of so many columns, of more where that would
make more sizes than the last."""


class CudaConjugateGradients:
    """Solves with the tangent of one body and its contacts."""

    def __init__(self, tangent: TangentStiffness, preconditioner: ConstraintPreconditioner) -> None:
        """Bind the parts.

        Args:
            tangent: K.
            preconditioner: Its rest state is a `DenseRest`, its compliance is inverted.
        """
        if not isinstance(preconditioner.rest, DenseRest) or not isinstance(preconditioner.solver, InvertedCompliance):
            raise TypeError(f"a dense rest state and inverted compliances, not {preconditioner.rest}")
        self._tangent, self._preconditioner = tangent, preconditioner
        self._rest, self._solver = preconditioner.rest, preconditioner.solver
        self._columns_of: dict[int, ActiveColumns] = {}
        self._step = _COLUMNS

    def solve(
        self, at: Linearization, r: torch.Tensor, gaps: Sequence[torch.Tensor], wanted: torch.Tensor, stopping: Stopping
    ) -> tuple[torch.Tensor, torch.Tensor, int]:
        """Solve K x = r + B^T p, B x = c; members stop by themselves.

        Args:
            at: The state of the tangent, float32.
            r: Right-hand sides of about norm 1, 0 where not wanted, shape (n, 3, b), float32.
            gaps: c, by contact, shape (s, b), 0 where not wanted.
            wanted: Members to solve for, shape (b,), bool.
            stopping: When to end.

        Returns:
            x, shape (n, 3, b), -p as `ConstraintPreconditioner.forces` takes it, and the iterations of the slowest.
        """
        answer = torch.zeros(r.shape[0] * 3, r.shape[2], device=r.device)
        forces = torch.zeros(r.shape[2], self._preconditioner.rows.most, device=r.device)
        self._step = max(self._step, _COLUMNS * -(-len(wanted) // (_COLUMNS * _WIDTHS)))
        count, iteration = int(wanted.sum()), 0
        if not count:
            return answer.view_as(r), forces, 0
        now = self._begin(at, r, gaps, wanted, count, stopping.tolerance)
        for iteration in range(1, stopping.limit + 1):
            now.run(self._iterate)
            left = int(now.going.sum())
            if stopping.enough(iteration, left, count):
                break
            if self._columns(left) <= _SHRINK * now.width:
                answer[:, now.member], forces[now.member] = now.x, now.total
                # Some that are done fill the columns up; they stay as they are.
                which = now.going.argsort(descending=True, stable=True)[: self._columns(left)]
                before, now = now, self._columns_of[self._columns(left)]
                now.take(before, which)
        answer[:, now.member], forces[now.member] = now.x, now.total
        return answer.view_as(r), forces, iteration

    def _begin(
        self,
        at: Linearization,
        r: torch.Tensor,
        gaps: Sequence[torch.Tensor],
        wanted: torch.Tensor,
        count: int,
        tolerance: float,
    ) -> ActiveColumns:
        # Others, whose right-hand side is 0, fill the columns up.
        member = wanted.to(torch.int32).argsort(descending=True, stable=True)[: self._columns(count)]
        for width in (*range(self._step, len(member), self._step), len(member)):
            if width not in self._columns_of:
                self._columns_of[width] = ActiveColumns(at, width, self._preconditioner, self._rest.padded)
        now = self._columns_of[len(member)]
        now.begin(at, member, wanted, r, tolerance)
        self._scale(now, now.r)
        self._hold(now, self._preconditioner.rows.wanted(gaps)[member])
        # What the constraints answer may be any multiple of the right-hand side.
        self._scale(now, now.r - self._rest.spread(now.soft) if self._tangent.surfaces[0].rough else now.r)
        self._turn(now, self._rest.times(now.h))
        return now

    def _scale(self, now: ActiveColumns, left: torch.Tensor) -> None:
        """Find by what residuals are multiplied for half precision, and round those that are left."""
        rest = self._rest
        now.size.zero_()
        self._sum(kernels.reach, now, left, rest.order, rest.scale, now.size)
        now.size.copy_(_ROOM / now.size.clamp_min(1e-30))
        torch.div(now.softness, now.size, out=now.factor)
        self._launch(kernels.load, (len(rest.order), now.width), left, rest.order, rest.scale, now.size, now.h)

    def _iterate(self, now: ActiveColumns) -> None:
        rest, rows = self._rest, len(self._rest.order)
        q = now.q.zero_().view_as(now.p)
        self._tangent.add_product(now.at, now.p.view_as(now.at.u), now.q)
        self._sum(kernels.curve, now, now.p, q, rest.order, now.curvature)
        self._launch(
            kernels.advance,
            (rows, now.width),
            now.x,
            now.r,
            now.p,
            q,
            now.rho,
            now.curvature,
            now.going,
            now.first,
            rest.order,
            rest.scale,
            now.size,
            now.h,
        )
        self._hold(now)
        w = rest.times(now.h)
        self._sum(kernels.measure, now, w, now.r, rest.order, rest.scale, now.factor, now.rho_new)
        self._launch(
            kernels.judge,
            now.width,
            now.rho_new,
            now.curvature,
            now.tolerance,
            now.goal,
            now.rho,
            now.beta,
            now.going,
            now.first,
        )
        self._turn(now, w)

    def _hold(self, now: ActiveColumns, wanted: torch.Tensor | None = None) -> None:
        """Take what the constraints answer off the residual; they are to change by ``wanted``, shape (b, a)."""
        rest, rows, shape = self._rest, self._preconditioner.rows, tuple(now.v.shape)
        if not shape[1]:
            return
        moved = rest.rows_times(now.h)
        rows.launch(constraint_kernels.along, shape, moved, rest.row_scale, now.factor, now.row, rows.data, now.v)
        if wanted is not None:
            now.v.sub_(wanted)
        rows.launch(
            constraint_kernels.answer,
            shape,
            self._solver.inverse,
            now.v,
            now.row,
            now.going,
            rows.data,
            now.y,
            now.total,
        )
        now.hard.zero_()
        now.soft.zero_()
        rows.launch(constraint_kernels.onto_rows, shape, now.y, now.row, rows.data, now.hard, now.soft)
        up = rest.spreads
        self._launch(
            kernels.spread,
            (len(up.row), now.width),
            up.start,
            up.column,
            up.value,
            up.row,
            now.hard,
            now.soft,
            rest.order,
            rest.scale,
            now.size,
            now.r,
            now.h,
        )

    def _turn(self, now: ActiveColumns, w: torch.Tensor) -> None:
        rest = self._rest
        self._launch(kernels.turn, (len(w), now.width), w, rest.order, rest.scale, now.factor, now.beta, now.p)

    def _sum(self, kernel: Any, now: ActiveColumns, *inputs: torch.Tensor) -> None:
        rows = len(self._rest.order)
        self._launch(kernel, (-(-rows // int(kernels.STRIP)), now.width), *inputs)

    def _launch(self, kernel: Any, dim: tuple[int, ...] | int, *inputs: object) -> None:
        device = str(self._rest.order.device)
        wp.launch(kernel, dim=dim, inputs=[*map(argument, inputs)], device=device)

    def _columns(self, members: int) -> int:
        return -(-members // self._step) * self._step
