"""The constraints' dense compliance S of many members, solved with: factorized on the CPU, inverted on a GPU.

Each member's matrix has the size of its own constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch

from tacdata.skin.linear.batched_inverse import ROWS, inverse_of

Assemble = Callable[[torch.Tensor, torch.Tensor], None]
"""Writes S of some members, by index, shape (g,), into a tensor of shape (g, a, a): its lower triangle."""

_ROOM = 2**28
"""Numbers in the matrices that are inverted at a time, 1 GiB: more only fill memory."""


class FactoredCompliance:
    """Cholesky factors, made in double precision and kept in single."""

    STEP = 1
    """Sizes that are worth being told apart."""

    def __init__(self) -> None:
        """Hold nothing."""
        self._factor: list[torch.Tensor] = []

    def update(self, sizes: Sequence[int], most: int, assemble: Assemble, device: torch.device) -> None:
        """Factorize.

        Args:
            sizes: Constraints of each member.
            most: Constraints for which `times` has columns.
            assemble: Writes the matrices.
            device: Where.
        """
        self._factor = []
        for member, size in enumerate(sizes):
            room = torch.empty(1, size, size, device=device)
            assemble(torch.tensor([member], device=device), room)
            self._factor.append(torch.linalg.cholesky(room[0].double()).float())

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

    STEP = ROWS

    def __init__(self) -> None:
        """Hold nothing."""
        self.inverse = torch.empty(0, 0, 0)
        """S^-1 of each member [N/mm], shape (b, a, a); beyond its own constraints anything finite."""
        self._sizes = torch.empty(0)

    def update(self, sizes: Sequence[int], most: int, assemble: Assemble, device: torch.device) -> None:
        """Invert; arguments as of `FactoredCompliance.update`."""
        self._sizes = torch.tensor(sizes, device=device)
        if self.inverse.shape != (len(sizes), most, most):
            self.inverse = torch.zeros(len(sizes), most, most, device=device)
        by_size: dict[int, list[int]] = {}
        for member, size in enumerate(sizes):
            if size:
                by_size.setdefault(-(-size // ROWS) * ROWS, []).append(member)
        for size, members in by_size.items():
            together = max(1, _ROOM // size**2)
            for start in range(0, len(members), together):
                member = torch.tensor(members[start : start + together], device=device)
                room = torch.empty(len(member), size, size, device=device)
                assemble(member, room)
                inverse_of(room, member, self.inverse)

    def times(self, v: torch.Tensor, member: torch.Tensor) -> torch.Tensor:
        """Return S^-1 v, as `FactoredCompliance.times`."""
        y = torch.bmm(self.inverse[member], v[:, :, None])[:, :, 0]
        return torch.where(torch.arange(v.shape[1], device=v.device) < self._sizes[member, None], y, 0.0)
