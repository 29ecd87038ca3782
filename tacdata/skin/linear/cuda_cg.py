"""Projected conjugate gradients on a GPU: those of `projected_cg`, kernels fused, in a batch that shrinks.

Members need very different numbers of iterations. Those that are done leave the batch once enough of them are, so that
the others do not pay for them. Residuals are multiplied with the rest state's inverse in half precision. So forces of
the constraints, which would drown the rest, are taken off the residual for good (Gould, Hribar and Nocedal, section 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from tacdata.skin.linear import constraint_kernels
from tacdata.skin.linear import cuda_cg_kernels as kernels
from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.constraint_solvers import InvertedCompliance
from tacdata.skin.linear.cuda_cg_columns import ActiveColumns
from tacdata.skin.linear.projected_cg import Stopping
from tacdata.skin.linear.rest_stiffness import DenseRest
from tacdata.skin.linear.tangent import Linearization, TangentStiffness
from tacdata.skin.member.warp_arrays import argument
from tacdata.warp_runtime import wp

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
        self, at: Linearization, r: torch.Tensor, gaps: Sequence[torch.Tensor], mask: torch.Tensor, stopping: Stopping
    ) -> tuple[torch.Tensor, torch.Tensor, int]:
        """Solve K x = r + B^T p, B x = c; members stop by themselves.

        Args:
            at: The state of the tangent, float32.
            r: Right-hand sides of about norm 1, 0 where not wanted, shape (n, 3, b), float32.
            gaps: c, by contact, shape (s, b), 0 where not wanted.
            mask: Members to solve for, shape (b,), bool.
            stopping: When to end.

        Returns:
            x, shape (n, 3, b), -p as `ConstraintPreconditioner.forces` takes it, and the iterations of the slowest.
        """
        answer = torch.zeros(r.shape[0] * 3, r.shape[2], device=r.device)
        forces = torch.zeros(r.shape[2], self._preconditioner.rows.most, device=r.device)
        # Few widths, as each has a recorded graph of its own and its own tensors.
        self._step = max(self._step, _COLUMNS * -(-len(mask) // (_COLUMNS * _WIDTHS)))
        count, iteration = int(mask.sum()), 0
        if not count:
            return answer.view_as(r), forces, 0
        active = self._begin(at, r, gaps, mask, count, stopping.tolerance)
        for iteration in range(1, stopping.limit + 1):
            active.run(self._iterate)
            # The only figure that the host waits for in an iteration.
            remaining = int(active.going.sum())
            if stopping.enough(iteration, remaining, count):
                break
            if self._columns(remaining) <= _SHRINK * active.width:
                answer[:, active.member], forces[active.member] = active.x, active.total
                # Some that are done fill the columns up; they stay as they are.
                which = active.going.argsort(descending=True, stable=True)[: self._columns(remaining)]
                previous, active = active, self._columns_of[self._columns(remaining)]
                active.take(previous, which)
        answer[:, active.member], forces[active.member] = active.x, active.total
        return answer.view_as(r), forces, iteration

    def _begin(
        self,
        at: Linearization,
        r: torch.Tensor,
        gaps: Sequence[torch.Tensor],
        mask: torch.Tensor,
        count: int,
        tolerance: float,
    ) -> ActiveColumns:
        # Others, whose right-hand side is 0, fill the columns up.
        member = mask.to(torch.int32).argsort(descending=True, stable=True)[: self._columns(count)]
        # Make every narrower width too: the batch shrinks through them.
        for width in (*range(self._step, len(member), self._step), len(member)):
            if width not in self._columns_of:
                self._columns_of[width] = ActiveColumns(at, width, self._preconditioner, self._rest.padded)
        active = self._columns_of[len(member)]
        active.begin(at, member, mask, r, tolerance)
        self._scale(active, active.r)
        self._hold(active, self._preconditioner.rows.wanted(gaps)[member])
        # The reaction of the constraints may be any multiple of the right-hand side.
        self._scale(active, active.r - self._rest.spread(active.soft) if self._tangent.surfaces[0].rough else active.r)
        self._turn(active, self._rest.times(active.h))
        return active

    def _scale(self, active: ActiveColumns, residual: torch.Tensor) -> None:
        """Find the factor of residuals for half precision, and round the active ones."""
        solver = self._rest
        active.size.zero_()
        self._sum(kernels.reach, active, residual, solver.order, solver.scale, active.size)
        # Half precision ends at 65,504, and loses digits below 6e-5: each column is scaled to use its range.
        active.size.copy_(_ROOM / active.size.clamp_min(1e-30))
        torch.div(active.softness, active.size, out=active.factor)
        self._launch(
            kernels.load, (len(solver.order), active.width), residual, solver.order, solver.scale, active.size, active.h
        )

    def _iterate(self, active: ActiveColumns) -> None:
        solver, rows = self._rest, len(self._rest.order)
        q = active.q.zero_().view_as(active.p)
        self._tangent.add_product(active.at, active.p.view_as(active.at.u), active.q)
        self._sum(kernels.curve, active, active.p, q, solver.order, active.curvature)
        self._launch(
            kernels.advance,
            (rows, active.width),
            active.x,
            active.r,
            active.p,
            q,
            active.rho,
            active.curvature,
            active.going,
            active.first,
            solver.order,
            solver.scale,
            active.size,
            active.h,
        )
        self._hold(active)
        w = solver.times(active.h)
        self._sum(kernels.measure, active, w, active.r, solver.order, solver.scale, active.factor, active.rho_new)
        self._launch(
            kernels.judge,
            active.width,
            active.rho_new,
            active.curvature,
            active.tolerance,
            active.goal,
            active.rho,
            active.beta,
            active.going,
            active.first,
        )
        self._turn(active, w)

    def _hold(self, active: ActiveColumns, mask: torch.Tensor | None = None) -> None:
        """Subtract the reaction of the constraints from the residual; they are to change by ``mask``, shape (b, a)."""
        solver, rows, shape = self._rest, self._preconditioner.rows, tuple(active.v.shape)
        if not shape[1]:
            return
        change = solver.rows_times(active.h)
        rows.launch(
            constraint_kernels.along, shape, change, solver.row_scale, active.factor, active.row, rows.data, active.v
        )
        if mask is not None:
            active.v.sub_(mask)
        rows.launch(
            constraint_kernels.answer,
            shape,
            self._solver.inverse,
            active.v,
            active.row,
            active.going,
            rows.data,
            active.y,
            active.total,
        )
        active.hard.zero_()
        active.soft.zero_()
        rows.launch(constraint_kernels.onto_rows, shape, active.y, active.row, rows.data, active.hard, active.soft)
        up = solver.spreads
        self._launch(
            kernels.spread,
            (len(up.row), active.width),
            up.start,
            up.column,
            up.value,
            up.row,
            active.hard,
            active.soft,
            solver.order,
            solver.scale,
            active.size,
            active.r,
            active.h,
        )

    def _turn(self, active: ActiveColumns, w: torch.Tensor) -> None:
        solver = self._rest
        self._launch(
            kernels.turn, (len(w), active.width), w, solver.order, solver.scale, active.factor, active.beta, active.p
        )

    def _sum(self, kernel: Any, active: ActiveColumns, *inputs: torch.Tensor) -> None:
        rows = len(self._rest.order)
        self._launch(kernel, (-(-rows // int(kernels.STRIP)), active.width), *inputs)

    def _launch(self, kernel: Any, dim: tuple[int, ...] | int, *inputs: object) -> None:
        device = str(self._rest.order.device)
        wp.launch(kernel, dim=dim, inputs=[*map(argument, inputs)], device=device)

    def _columns(self, members: int) -> int:
        return -(-members // self._step) * self._step
