"""The constraints' dense compliance S of many members, solved with: factorized on the CPU, inverted on a GPU.

Each member's matrix has the size of its own constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial

import torch

from tacdata.skin.linear.batched_inverse import ROWS, inverse_of
from tacdata.warp_runtime import wp

Assemble = Callable[[torch.Tensor, torch.Tensor], None]
"""Writes S of some members, by index, shape (g,), into a tensor of shape (g, a, a): its lower triangle."""

_ROOM = 2**28
"""Numbers in the matrices that are inverted at a time, 1 GiB: more only fill memory."""


class FactoredCompliance:
    """Cholesky factors, made in double precision and kept in single."""

    STEP = 1
    """Granularity of sizes."""

    place = ()
    """Nothing that stays where it is."""

    def __init__(self) -> None:
        """Hold nothing."""
        self._factor: list[torch.Tensor] = []

    def update(
        self, sizes: Sequence[int], changed: Sequence[int], capacity: int, assemble: Assemble, device: torch.device
    ) -> None:
        """Factorize.

        Args:
            sizes: Constraints of each member.
            changed: Members whose matrices are others than before.
            capacity: Constraints for which `times` has columns.
            assemble: Writes the matrices.
            device: Where.
        """
        empty = torch.empty(0, 0, device=device)
        self._factor += [empty] * (len(sizes) - len(self._factor))
        for member in changed:
            room = torch.empty(1, sizes[member], sizes[member], device=device)
            assemble(torch.tensor([member], device=device), room)
            # Nearly dependent constraints break a factorization in single precision, but not the solves by its factor.
            self._factor[member] = torch.linalg.cholesky(room[0].double()).float()

    def times(self, v: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return S^-1 v of members, by index; v of shape (b, a), zero beyond their own constraints."""
        y = torch.zeros_like(v)
        for column, number in enumerate(member.tolist()):
            factor = self._factor[number]
            size = len(factor)
            if size:
                y[column, :size] = torch.cholesky_solve(v[column, :size, None], factor)[:, 0]
        return y


class InvertedCompliance:
    """Inverses, for many members at once; in a tensor that keeps its place while it is large enough."""

    STEP = 2 * ROWS

    def __init__(self) -> None:
        """Hold nothing."""
        self.inverse = torch.empty(0, 0, 0)
        """S^-1 of each member [N/mm], shape (b, a, a); beyond its own constraints anything finite."""
        self._sizes = torch.empty(0)

    @property
    def place(self) -> tuple[int, ...]:
        """Where the inverses are: the same while the tensor stays."""
        return (self.inverse.data_ptr(),)

    def update(
        self, sizes: Sequence[int], changed: Sequence[int], capacity: int, assemble: Assemble, device: torch.device
    ) -> None:
        """Invert; arguments as of `FactoredCompliance.update`."""
        self._sizes = torch.tensor(sizes, device=device)
        if len(sizes) > len(self.inverse) or capacity != self.inverse.shape[1]:
            self.inverse = torch.zeros(max(len(sizes), len(self.inverse)), capacity, capacity, device=device)
        by_size: dict[int, list[int]] = {}
        for member in changed:
            if sizes[member]:
                # Sizes are rounded up, so that members of about one size are inverted in one call. To multiples of 256
                # it would be 1.4 times the work (326 sets of constraints under random spheres, 300 in the mean).
                by_size.setdefault(-(-sizes[member] // ROWS) * ROWS, []).append(member)
        parts = [
            (size, torch.tensor(members[start : start + max(1, _ROOM // size**2)], device=device))
            # The largest begin first: they take longest, and the streams finish together.
            for size, members in sorted(by_size.items(), reverse=True)
            for start in range(0, len(members), max(1, _ROOM // size**2))
        ]

        def invert(size: int, member: torch.Tensor) -> None:
            room = torch.empty(len(member), size, size, device=device)
            assemble(member, room)
            inverse_of(room, member, self.inverse)

        side_by_side([partial(invert, *part) for part in parts], device)

    def times(self, v: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return S^-1 v, as `FactoredCompliance.times`."""
        y = torch.bmm(self.inverse[member], v[:, :, None])[:, :, 0]
        return torch.where(torch.arange(v.shape[1], device=v.device) < self._sizes[member, None], y, 0.0)


_STREAMS = 4
"""Sizes that are worked on at a time: each is a chain of short kernels that leave most of a GPU idle."""


def side_by_side(tasks: Sequence[Callable[[], None]], device: torch.device) -> None:
    """Run tasks that do not need each other, on a GPU each on one of a few streams."""
    if device.type == "cpu" or len(tasks) < 2:
        for task in tasks:
            task()
        return
    current = torch.cuda.current_stream(device)
    streams = _streams(str(device))
    for stream in streams:
        stream.wait_stream(current)
    for number, task in enumerate(tasks):
        stream = streams[number % _STREAMS]
        with torch.cuda.stream(stream), wp.ScopedStream(wp.stream_from_torch(stream), sync_enter=False):
            task()
    for stream in streams:
        current.wait_stream(stream)


@cache
def _streams(device: str) -> list[torch.cuda.Stream]:
    return [torch.cuda.Stream(device) for _ in range(_STREAMS)]
