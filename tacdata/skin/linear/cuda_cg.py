"""Conjugate gradients for a batch on a GPU: those of `linear.cg`, kernels fused, in a batch that shrinks.

Members need very different numbers of iterations, on average half of what the slowest ones need. Those that are done
leave the batch once enough of them are, so that the others do not pay for them.
"""

from __future__ import annotations

from typing import Any

import torch
import warp as wp

from tacdata.skin.linear import cuda_cg_kernels as kernels
from tacdata.skin.linear.cg import Stopping
from tacdata.skin.linear.contact_preconditioner import ContactPreconditioner
from tacdata.skin.linear.cuda_cg_columns import ActiveColumns
from tacdata.skin.linear.tangent import Linearization, TangentStiffness
from tacdata.skin.member.warp_arrays import argument

_ROOM = 256.0
"""To which residuals are scaled for half precision: they may grow as much again."""

_SHRINK, _COLUMNS, _WIDTHS = 0.85, 32, 8
"""Share of a batch that may be left before it shrinks [1], to a multiple of so many columns, of more where that would
make more sizes than the last."""

_STRIDE = 2
"""The GPU is asked who has finished only now and then, so that it seldom waits for the host."""


class CudaConjugateGradients:
    """Solves with the tangent of one body and its contacts."""

    def __init__(self, tangent: TangentStiffness, preconditioner: ContactPreconditioner) -> None:
        """Bind the parts; the preconditioner's rest state is a `tacdata.skin.linear.rest_stiffness.DenseRest`."""
        self._tangent, self._preconditioner = tangent, preconditioner
        self._columns_of: dict[int, ActiveColumns] = {}
        self._step = _COLUMNS

    def solve(
        self, at: Linearization, r: torch.Tensor, wanted: torch.Tensor, stopping: Stopping
    ) -> tuple[torch.Tensor, int]:
        """Solve K x = r; members stop by themselves.

        Args:
            at: The state of the tangent, float32.
            r: Right-hand sides of norm 1, 0 where not wanted, shape (n, 3, b), float32.
            wanted: Members to solve for, shape (b,), bool.
            stopping: When to end.

        Returns:
            x, shape (n, 3, b), and the iterations of the slowest member.
        """
        answer = torch.zeros(r.shape[0] * 3, r.shape[2], device=r.device)
        self._step = _COLUMNS * -(-len(wanted) // (_COLUMNS * _WIDTHS))
        count, iteration = int(wanted.sum()), 0
        if not count:
            return answer.view_as(r), 0
        now = self._begin(at, r, wanted, count, stopping.tolerance)
        for iteration in range(1, stopping.limit + 1):
            now.run(self._iterate)
            if iteration % _STRIDE:
                continue
            left = int(now.going.sum())
            if stopping.enough(iteration, left, count):
                break
            if self._columns(left) <= _SHRINK * now.width:
                answer[:, now.member] = now.x
                # Some that are done fill the columns up; they stay as they are.
                which = now.going.argsort(descending=True, stable=True)[: self._columns(left)]
                before, now = now, self._columns_of[self._columns(left)]
                now.take(before, which)
        answer[:, now.member] = now.x
        return answer.view_as(r), iteration

    def _begin(
        self, at: Linearization, r: torch.Tensor, wanted: torch.Tensor, count: int, tolerance: float
    ) -> ActiveColumns:
        rest = self._preconditioner.rest
        # Others, whose right-hand side is 0, fill the columns up.
        member = wanted.to(torch.int32).argsort(descending=True, stable=True)[: self._columns(count)]
        for width in (*range(self._step, len(member), self._step), len(member)):
            if width not in self._columns_of:
                self._columns_of[width] = ActiveColumns(at, width, rest.padded)
        now = self._columns_of[len(member)]
        now.begin(at, member, r, self._preconditioner.share())
        largest = (now.r[rest.order] * rest.scale[:, None]).abs().amax(dim=0)
        now.size.copy_(_ROOM / largest.clamp_min(1e-30))
        self._launch(kernels.load, (len(rest.order), now.width), now.r, rest.order, rest.scale, now.size, now.h)
        w = self._precondition(now)
        self._sum(kernels.measure, now, w, now.r, rest.order, rest.scale, now.softness, now.size, now.rho)
        now.goal.copy_(now.rho * tolerance**2)
        now.going.copy_(now.rho > 0)
        self._turn(now, w)
        return now

    def _iterate(self, now: ActiveColumns) -> None:
        rest, rows = self._preconditioner.rest, len(self._preconditioner.rest.order)
        q = now.q.zero_().view_as(now.p)
        self._tangent.add_product(now.at, now.p.view_as(now.at.u), now.q)
        self._sum(kernels.curve, now, now.p, q, rest.order, now.curvature)
        self._launch(
            kernels.advance, (rows, now.width), now.x, now.r, now.p, q, now.rho, now.curvature, now.going, now.first,
            rest.order, rest.scale, now.size, now.h,
        )
        w = self._precondition(now)
        self._sum(kernels.measure, now, w, now.r, rest.order, rest.scale, now.softness, now.size, now.rho_new)
        self._launch(
            kernels.judge, now.width, now.rho_new, now.goal, now.curvature, now.rho, now.beta, now.going, now.first
        )
        self._turn(now, w)

    def _precondition(self, now: ActiveColumns) -> torch.Tensor:
        """Return the preconditioned residual on the rows of the inverse, scaled like `ActiveColumns.h`."""
        rest, share, shape = self._preconditioner.rest, now.share, tuple(now.moved.shape)
        if shape[1]:
            z, count = rest.times(now.h, rest.count), wp.int64(rest.count)
            self._launch(
                kernels.pick, shape, z, share.which, now.row, rest.scale, now.softness, now.size, count, now.moved
            )
            self._launch(
                kernels.push_back, shape, share.transfer, now.moved, share.which, now.row, now.own, rest.order,
                rest.scale, now.size, count, now.r, now.h,
            )
        return rest.times(now.h)

    def _turn(self, now: ActiveColumns, w: torch.Tensor) -> None:
        rest = self._preconditioner.rest
        self._launch(kernels.turn, tuple(w.shape), w, rest.order, rest.scale, now.softness, now.size, now.beta, now.p)

    def _sum(self, kernel: Any, now: ActiveColumns, *inputs: torch.Tensor) -> None:
        rows = len(self._preconditioner.rest.order)
        self._launch(kernel, (-(-rows // int(kernels.STRIP)), now.width), *inputs)

    def _launch(self, kernel: Any, dim: tuple[int, ...] | int, *inputs: object) -> None:
        device = str(self._preconditioner.rest.order.device)
        wp.launch(kernel, dim=dim, inputs=[*map(argument, inputs)], device=device)

    def _columns(self, members: int) -> int:
        return -(-members // self._step) * self._step
