"""States passed while loading: where unloading starts from."""

from __future__ import annotations

import torch

from tacdata.skin.solve.configuration import Unknowns


class LoadingStates:
    """For every member of a batch, displacements and multipliers at the depths it passed on its way down."""

    def __init__(self, sample: Unknowns) -> None:
        """Make room for unknowns such as ``sample``."""
        batch, device = sample.u.shape[2], sample.u.device
        self._shapes = [field.shape[:-1] for field in (sample.u, *sample.multipliers)]
        self._sizes = [shape.numel() for shape in self._shapes]  # ty: ignore[missing-attribute]
        self._depth = torch.full((4, batch), torch.inf, dtype=torch.float64, device=device)
        self._values = torch.zeros(4, sum(self._sizes), batch, dtype=torch.float32, device=device)
        self._count = torch.zeros(batch, dtype=torch.int64, device=device)

    @property
    def deepest(self) -> torch.Tensor:
        """The deepest passed [mm], shape (b,)."""
        last = (self._count - 1).clamp_min(0)
        return self._depth.gather(0, last[None])[0]

    def forget(self, which: torch.Tensor) -> None:
        """Reset members, by index or mask, flat at depth 0."""
        self._depth[:, which] = torch.inf
        self._depth[0, which] = 0.0
        self._values[:, :, which] = 0.0
        self._count[which] = 1

    def keep(self, which: torch.Tensor) -> None:
        """Let go of all members but some, by index, shape (k,)."""
        self._depth, self._count = self._depth[:, which], self._count[which]
        self._values = self._values[:, :, which]

    def add(self, which: torch.Tensor, depth: torch.Tensor, state: Unknowns) -> None:
        """Keep the marked members' unknowns at depths [mm], shape (b,), if deeper."""
        column = (which & (depth > self.deepest)).nonzero().squeeze(1)
        if not len(column):
            return
        row = self._count[column]
        if int(row.max()) == len(self._depth):
            self._depth = torch.cat([self._depth, torch.full_like(self._depth, torch.inf)])
            self._values = torch.cat([self._values, torch.zeros_like(self._values)])
        self._depth[row, column] = depth[column]
        single = state.take(column)
        flat = torch.cat(
            [field.reshape(size, -1) for field, size in zip((single.u, *single.multipliers), self._sizes, strict=True)]
        )
        # Single precision serves for a start and halves the memory of a batch.
        self._values[row, :, column] = flat.T.to(torch.float32)
        self._count[column] += 1

    def at(self, depth: torch.Tensor) -> Unknowns:
        """Interpolate unknowns, float64, at depths [mm], shape (b,)."""
        after = (self._depth < depth).sum(dim=0).minimum(self._count - 1).clamp_min(1)
        low, high = (self._depth.gather(0, row[None])[0] for row in (after - 1, after))
        # Rows that are not filled have infinite depth: then the last state is used as it is.
        share = torch.where(torch.isfinite(high), (depth - low) / (high - low), 0.0)
        lower, upper = (self._row(row) for row in (after - 1, after))
        flat = lower + share * (upper - lower).to(torch.float64)
        u, *multipliers = (
            part.reshape(*shape, -1) for part, shape in zip(flat.split(self._sizes), self._shapes, strict=True)
        )
        return Unknowns(u, tuple(multipliers))

    def back(self, state: Unknowns, depth: torch.Tensor, attempt: torch.Tensor, leaves: bool) -> Unknowns:
        """Return a start for a step back up: the state there on the way down, and the change by friction since.

        Args:
            state: Unknowns at the last equilibrium.
            depth: Its depth [mm], shape (b,).
            attempt: The depth to start at, likewise.
            leaves: Whether the skin is flat once the shape is back where it touched.
        """
        lag = torch.where(attempt > 0, 1.0, 0.0) if leaves else 1.0
        return self.at(attempt).plus(state.minus(self.at(depth)), lag)

    def _row(self, row: torch.Tensor) -> torch.Tensor:
        return self._values.gather(0, row[None, None, :].expand(1, *self._values.shape[1:]))[0]
