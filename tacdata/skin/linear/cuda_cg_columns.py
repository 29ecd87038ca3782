"""Members in work by conjugate gradients on a card, in tensors that stay where they are.

As they stay, an iteration can be recorded once as a graph and then be replayed: launching its two dozen kernels one by
one takes the host longer than the card takes to run them.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import warp as wp

from tacdata.skin.contact.contact import Contact
from tacdata.skin.linear.contact_preconditioner import Share
from tacdata.skin.member.conditions import Conditions

_FIELDS = ("u", "x", "r", "p", "swelling")
_VALUES = ("member", "softness", "row", "own", "size", "rho", "goal", "going", "first")


class Lane:
    """So many columns, each with a member that is solved for."""

    def __init__(
        self, u: torch.Tensor, swelling: torch.Tensor | None, conditions: Conditions, contacts: list[Contact],
        width: int, rows: int,
    ) -> None:
        """Make room.

        Args:
            u: Displacements of a whole batch, shape (n, 3, c): for their size and device.
            swelling: Of the same (`Elasticity.swelling`), if any.
            conditions: Of the same.
            contacts: Evaluated for the same.
            width: Number of columns b.
            rows: Of what the rest state's inverse is multiplied with.
        """
        device, nodes = u.device, u.shape[0]
        some = torch.zeros(width, dtype=torch.int64, device=device)
        self.width = width
        self.conditions, self.contacts = conditions.take(some), [contact.take(some) for contact in contacts]

        def zeros(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
            return torch.zeros(*shape, width, dtype=dtype, device=device)

        self.u = zeros(nodes, 3)
        """Displacements [mm], shape (n, 3, b)."""
        self.swelling = None if swelling is None else zeros(len(swelling))
        self.x, self.r, self.p = zeros(3 * nodes), zeros(3 * nodes), zeros(3 * nodes)
        """Solution, residual and direction, shape (3n, b)."""
        self.q = zeros(nodes, 3)
        """The tangent times the direction, shape (n, 3, b)."""
        self.h = zeros(rows, dtype=torch.float16)
        """The residual, scaled, on the rows of the inverse."""
        self.member = zeros(dtype=torch.int64)
        """Columns in the whole batch, shape (b,), as all that follows."""
        self.row, self.own = zeros(dtype=torch.int32), zeros(dtype=torch.int32)
        """Row of the contact's shares, and how many degrees of freedom are touched."""
        self.softness, self.size = zeros(), zeros()
        """Nominal modulus over the member's; by what residuals are multiplied for half precision [1]."""
        self.rho, self.goal = zeros(), zeros()
        """Squared preconditioned norms of the residual: now, and where to stop."""
        self.going, self.first = zeros(dtype=torch.int32), zeros(dtype=torch.int32)
        """1 where not done; 1 in the first iteration."""
        self.curvature, self.rho_new, self.beta = zeros(), zeros(), zeros()
        self.moved, self.share = torch.empty(0), Share.none(device)
        self._seen = 0
        self._graph: torch.cuda.CUDAGraph | None = None

    def begin(
        self, member: torch.Tensor, u: torch.Tensor, r: torch.Tensor, swelling: torch.Tensor | None,
        conditions: Conditions, contacts: list[Contact], share: Share,
    ) -> None:
        """Take members of a whole batch, by index; arguments as of `Lane` and `CardGradients.solve`."""
        self.member.copy_(member)
        torch.index_select(u, -1, member, out=self.u)
        torch.index_select(r.reshape(-1, r.shape[2]), -1, member, out=self.r)
        if self.swelling is not None and swelling is not None:
            torch.index_select(swelling, -1, member, out=self.swelling)
        self.row.copy_(member)
        self.softness.copy_(share.softness[member])
        self.own.copy_(share.own[member])
        for values in (self.x, self.p, self.rho, self.rho_new, self.beta, self.curvature):
            values.zero_()
        self.going.fill_(1)
        self.first.fill_(1)
        self._bind(conditions, contacts, member, share)

    def take(self, other: Lane, which: torch.Tensor) -> None:
        """Take members of another lane, by index."""
        for name in (*_FIELDS, *_VALUES):
            mine = getattr(self, name)
            if mine is not None:
                torch.index_select(getattr(other, name), -1, which, out=mine)
        for values in (self.rho_new, self.curvature):
            values.zero_()
        self._bind(other.conditions, other.contacts, which, other.share)

    def _bind(self, conditions: Conditions, contacts: list[Contact], which: torch.Tensor, share: Share) -> None:
        self.conditions.retake(conditions, which)
        for mine, theirs in zip(self.contacts, contacts, strict=True):
            mine.retake(theirs, which)
        if share.place != self.share.place:
            self.moved = torch.zeros(self.width, share.which.shape[1], device=share.which.device)
            self._seen, self._graph = 0, None
        self.share = share

    def run(self, iteration: Callable[[Lane], None]) -> None:
        """Run an iteration: as it stands at first, so that its kernels are loaded, then from its graph."""
        if self.u.is_cuda and self._graph is None and self._seen:
            self._graph = self._record(iteration)
        if self._graph is None:
            iteration(self)
        else:
            self._graph.replay()
        self._seen += 1

    def _record(self, iteration: Callable[[Lane], None]) -> torch.cuda.CUDAGraph:
        graph, side = torch.cuda.CUDAGraph(), torch.cuda.Stream(self.u.device)
        side.wait_stream(torch.cuda.current_stream(self.u.device))
        with torch.cuda.stream(side), wp.ScopedStream(wp.stream_from_torch(side), sync_enter=False):
            graph.capture_begin()
            iteration(self)
            graph.capture_end()
        torch.cuda.current_stream(self.u.device).wait_stream(side)
        return graph
