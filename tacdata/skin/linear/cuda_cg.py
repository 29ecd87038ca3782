"""Conjugate gradients for a batch on a GPU: those of `solve.newton`, kernels fused, in a batch that shrinks.

Members need very different numbers of iterations, on average half of what the slowest ones need. Those that are done
leave the batch once enough of them are, so that the others do not pay for them.
"""

from __future__ import annotations

from typing import Any

import torch
import warp as wp

from tacdata.skin.contact.contact import Contact
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear import cuda_cg_kernels as kernels
from tacdata.skin.linear.contact_preconditioner import ContactPreconditioner
from tacdata.skin.linear.cuda_cg_columns import Lane
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.warp_arrays import handed

_ROOM = 256.0
"""To which residuals are scaled for half precision: they may grow as much again."""

_SHRINK, _COLUMNS, _LANES = 0.85, 32, 8
"""Share of a batch that may be left before it shrinks [1], to a multiple of so many columns, of more where that would
make more sizes than the last."""

_STRIDE = 2
"""A card is asked who has finished only now and then, so that it seldom waits for the host."""


class CardGradients:
    """Solves with the tangent of one body and its contacts."""

    def __init__(self, body: Elasticity, contacts: list[Contact], preconditioner: ContactPreconditioner) -> None:
        """Bind the parts; the preconditioner's rest state is a `tacdata.skin.linear.rest_stiffness.DenseRest`."""
        self._body, self._contacts, self._preconditioner = body, contacts, preconditioner
        self._lanes: dict[int, Lane] = {}
        self._step = _COLUMNS

    def solve(
        self, u: torch.Tensor, r: torch.Tensor, conditions: Conditions, wanted: torch.Tensor, tolerance: float,
        limit: int, stragglers: float, long: int,
    ) -> tuple[torch.Tensor, int]:
        """Solve K(u) x = r to a relative tolerance in the preconditioned norm; members stop by themselves.

        Args:
            u: Displacements [mm], shape (n, 3, b), float32.
            r: Right-hand sides of norm 1, 0 where not wanted, shape (n, 3, b), float32.
            conditions: Of the members, float32.
            wanted: Members to solve for, shape (b,), bool.
            tolerance: Relative [1].
            limit: Iterations at most.
            stragglers: Share of the wanted members that are cut short after ``long`` iterations [1].
            long: See there.

        Returns:
            x, shape (n, 3, b), and the iterations of the slowest member.
        """
        answer = torch.zeros(r.shape[0] * 3, r.shape[2], device=r.device)
        self._step = _COLUMNS * -(-len(wanted) // (_COLUMNS * _LANES))
        count, iteration = int(wanted.sum()), 0
        if not count:
            return answer.view_as(r), 0
        now = self._begin(u, r, conditions, wanted, count, tolerance)
        patient = int(stragglers * count)
        for iteration in range(1, limit + 1):
            now.run(self._iterate)
            if iteration % _STRIDE:
                continue
            left = int(now.going.sum())
            if not left or (iteration >= long and left <= patient):
                break
            if self._columns(left) <= _SHRINK * now.width:
                answer[:, now.member] = now.x
                # Some that are done fill the columns up; they stay as they are.
                which = now.going.argsort(descending=True, stable=True)[: self._columns(left)]
                before, now = now, self._lanes[self._columns(left)]
                now.take(before, which)
        answer[:, now.member] = now.x
        return answer.view_as(r), iteration

    def _begin(
        self, u: torch.Tensor, r: torch.Tensor, conditions: Conditions, wanted: torch.Tensor, count: int,
        tolerance: float,
    ) -> Lane:
        rest, swelling = self._preconditioner.rest, self._body.swelling(u, conditions)
        # Others, whose right-hand side is 0, fill the columns up.
        member = wanted.to(torch.int32).argsort(descending=True, stable=True)[: self._columns(count)]
        for width in (*range(self._step, len(member), self._step), len(member)):
            if width not in self._lanes:
                self._lanes[width] = Lane(u, swelling, conditions, self._contacts, width, rest.padded)
        now = self._lanes[len(member)]
        now.begin(member, u, r, swelling, conditions, self._contacts, self._preconditioner.share())
        largest = (now.r[rest.order] * rest.scale[:, None]).abs().amax(dim=0)
        now.size.copy_(_ROOM / largest.clamp_min(1e-30))
        self._launch(kernels.load, (len(rest.order), now.width), now.r, rest.order, rest.scale, now.size, now.h)
        w = self._precondition(now)
        self._sum(kernels.measure, now, w, now.r, rest.order, rest.scale, now.softness, now.size, now.rho)
        now.goal.copy_(now.rho * tolerance**2)
        now.going.copy_(now.rho > 0)
        self._turn(now, w)
        return now

    def _iterate(self, now: Lane) -> None:
        rest, rows = self._preconditioner.rest, len(self._preconditioner.rest.order)
        q = now.q.zero_().view_as(now.p)
        p = now.p.view_as(now.u)
        self._body.tangent_product(now.u, p, now.conditions, now.q, now.swelling)
        for contact in now.contacts:
            contact.add_product(p, now.q)
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

    def _precondition(self, now: Lane) -> torch.Tensor:
        """Return the preconditioned residual on the rows of the inverse, scaled like `Lane.h`."""
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

    def _turn(self, now: Lane, w: torch.Tensor) -> None:
        rest = self._preconditioner.rest
        self._launch(kernels.turn, tuple(w.shape), w, rest.order, rest.scale, now.softness, now.size, now.beta, now.p)

    def _sum(self, kernel: Any, now: Lane, *inputs: torch.Tensor) -> None:
        rows = len(self._preconditioner.rest.order)
        self._launch(kernel, (-(-rows // int(kernels.STRIP)), now.width), *inputs)

    def _launch(self, kernel: Any, dim: tuple[int, ...] | int, *inputs: object) -> None:
        device = str(self._preconditioner.rest.order.device)
        wp.launch(kernel, dim=dim, inputs=[*map(handed, inputs)], device=device)

    def _columns(self, members: int) -> int:
        return -(-members // self._step) * self._step
