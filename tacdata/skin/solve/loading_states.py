"""States passed while loading: where unloading starts from."""

from __future__ import annotations

import torch


class LoadingStates:
    """For every member of a batch, the displacements at the depths it passed on its way down."""

    def __init__(self, shape: tuple[int, int, int], device: str) -> None:
        """Make room for fields of ``shape`` (n, 3, b)."""
        self._shape, self._device = shape, device
        self._depth = torch.full((4, shape[2]), torch.inf, dtype=torch.float64, device=device)
        self._u = torch.zeros(4, *shape, dtype=torch.float32, device=device)
        self._count = torch.zeros(shape[2], dtype=torch.int64, device=device)

    @property
    def deepest(self) -> torch.Tensor:
        """The deepest passed [mm], shape (b,)."""
        last = (self._count - 1).clamp_min(0)
        return self._depth.gather(0, last[None])[0]

    def forget(self, which: torch.Tensor) -> None:
        """Start the marked members, shape (b,), bool, anew, flat at depth 0."""
        self._depth[:, which] = torch.inf
        self._depth[0, which] = 0.0
        self._u[:, :, :, which] = 0.0
        self._count[which] = 1

    def add(self, which: torch.Tensor, depth: torch.Tensor, u: torch.Tensor) -> None:
        """Keep the marked members' displacements [mm], shape (n, 3, b), at depths [mm], shape (b,), if deeper."""
        column = (which & (depth > self.deepest)).nonzero().squeeze(1)
        if not len(column):
            return
        row = self._count[column]
        if int(row.max()) == len(self._depth):
            self._depth = torch.cat([self._depth, torch.full_like(self._depth, torch.inf)])
            self._u = torch.cat([self._u, torch.zeros_like(self._u)])
        self._depth[row, column] = depth[column]
        self._u[row, :, :, column] = u[:, :, column].permute(2, 0, 1).to(torch.float32)
        self._count[column] += 1

    def at(self, depth: torch.Tensor) -> torch.Tensor:
        """Interpolate displacements [mm], shape (n, 3, b), float64, at depths [mm], shape (b,)."""
        after = (self._depth < depth).sum(dim=0).minimum(self._count - 1).clamp_min(1)
        low, high = (self._depth.gather(0, row[None])[0] for row in (after - 1, after))
        share = torch.where(torch.isfinite(high), (depth - low) / (high - low), 0.0)
        lower, upper = (self._row(row) for row in (after - 1, after))
        return lower + share * (upper - lower).to(torch.float64)

    def _row(self, row: torch.Tensor) -> torch.Tensor:
        return self._u.gather(0, row[None, None, None, :].expand(1, *self._shape))[0]
