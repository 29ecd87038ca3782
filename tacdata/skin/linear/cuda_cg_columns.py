"""Members in work by conjugate gradients on a GPU, in tensors that stay where they are.

So an iteration can be recorded once as a CUDA graph and then be replayed. Launching its two dozen kernels one by one
takes the host longer than the GPU takes to run them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import torch

from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.tangent import Linearization
from tacdata.warp_runtime import wp

_FIELDS = ("x", "r", "p")
_ALIGNED = 8
"""Columns are padded to a multiple of this, as libraries multiply others at a fraction of the rate."""
_VALUES = ("member", "row", "softness", "size", "factor", "rho", "goal", "going", "first")


class ActiveColumns:
    """So many columns b, each with a batch member that is solved for."""

    def __init__(self, at: Linearization, width: int, preconditioner: ConstraintPreconditioner, padded: int) -> None:
        """Make room.

        Args:
            at: State of a whole batch: for its sizes and device.
            width: Number of columns.
            preconditioner: Whose constraints are held.
            padded: Rows of the right-hand side of the rest state's inverse.
        """
        device, nodes = at.u.device, at.u.shape[0]
        index = torch.zeros(width, dtype=torch.int64, device=device)
        self.width, self._preconditioner = width, preconditioner
        self.at = at.take(index)
        """The state of these members."""

        def zeros(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
            return torch.zeros(*shape, width, dtype=dtype, device=device)

        self.x, self.r, self.p = zeros(3 * nodes), zeros(3 * nodes), zeros(3 * nodes)
        """Solution, residual and direction, shape (3n, b)."""
        self.q = zeros(nodes, 3)
        """The tangent times the direction, shape (n, 3, b)."""
        self.h = torch.zeros(padded, -(-width // _ALIGNED) * _ALIGNED, dtype=torch.float16, device=device)
        """The residual, scaled, on the rows of the inverse; columns beyond b are zero."""
        self.hard, self.soft = (zeros(preconditioner.rows.count) for _ in range(2))
        """Forces of hard and of soft constraints on the mortar rows, shape (m, b)."""
        self.member, self.row = zeros(dtype=torch.int64), zeros(dtype=torch.int32)
        """Columns in the whole batch, shape (b,), as all that follows."""
        self.softness, self.size, self.factor = zeros(), zeros(), zeros()
        """Nominal modulus over the member's; factor of residuals for half precision [1]; their ratio."""
        self.rho, self.goal = zeros(), zeros()
        """Squared preconditioned norms of the residual: now, and where to stop."""
        self.going, self.first = zeros(dtype=torch.int32), zeros(dtype=torch.int32)
        """1 where not done; 1 in the first iteration."""
        self.curvature, self.rho_new, self.beta = zeros(), zeros(), zeros()
        self.tolerance = torch.zeros(1, device=device)
        self._place: tuple[int, ...] | None = None
        self._seen = 0
        self._graph: torch.cuda.CUDAGraph | None = None
        self._bind()

    def begin(
        self, at: Linearization, member: torch.Tensor, mask: torch.Tensor, r: torch.Tensor, tolerance: float
    ) -> None:
        """Take members of a whole batch, by index; other arguments as of `cuda_cg.CudaConjugateGradients.solve`."""
        self.member.copy_(member)
        self.row.copy_(member)
        torch.index_select(r.reshape(-1, r.shape[2]), -1, member, out=self.r)
        self.softness.copy_(self._preconditioner.scale[member])
        self.going.copy_(mask[member])
        self.first.fill_(1)
        self.tolerance.fill_(tolerance)
        self.at.take_into(at, member)
        self._bind()
        for values in (self.x, self.p, self.rho, self.rho_new, self.beta, self.curvature, self.total, self.soft):
            values.zero_()

    def take(self, source: ActiveColumns, which: torch.Tensor) -> None:
        """Take members of others, by index."""
        for name in (*_FIELDS, *_VALUES):
            torch.index_select(getattr(source, name), -1, which, out=getattr(self, name))
        for values in (self.rho_new, self.curvature):
            values.zero_()
        self.tolerance.copy_(source.tolerance)
        self.at.take_into(source.at, which)
        self._bind()
        torch.index_select(source.total, 0, which, out=self.total)

    def _bind(self) -> None:
        """Allocate for the present constraints; graphs recorded for another allocation are dropped."""
        rows = self._preconditioner.rows
        place = *rows.place, *self._preconditioner.solver.place
        if place != self._place:
            self.v, self.y, self.total = (torch.zeros(self.width, rows.most, device=self.x.device) for _ in range(3))
            self._place, self._seen, self._graph = place, 0, None

    def run(self, iteration: Callable[[ActiveColumns], None]) -> None:
        """Run an iteration: directly at first, so that its kernels are loaded, then from its graph."""
        if self.x.is_cuda and self._graph is None and self._seen:
            self._graph = self._record(iteration)
        if self._graph is None:
            iteration(self)
        else:
            self._graph.replay()
        self._seen += 1

    def _record(self, iteration: Callable[[ActiveColumns], None]) -> torch.cuda.CUDAGraph:
        graph, side = torch.cuda.CUDAGraph(), torch.cuda.Stream(self.x.device)
        side.wait_stream(torch.cuda.current_stream(self.x.device))
        with torch.cuda.stream(side), wp.ScopedStream(wp.stream_from_torch(side), sync_enter=False):
            graph.capture_begin()
            try:
                iteration(self)
            except BaseException:
                # Until the recording is ended nothing can be freed, and an error of that would hide this one.
                with suppress(RuntimeError):
                    graph.capture_end()
                raise
            graph.capture_end()
        torch.cuda.current_stream(self.x.device).wait_stream(side)
        return graph
