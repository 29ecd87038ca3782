"""A press on a coarser mesh: its changes from depth to depth start those of the finer one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from tacdata.skin.solve.configuration import Unknowns
from tacdata.skin.solve.mesh_transfer import MeshTransfer


@dataclass(frozen=True)
class CoarsePath:
    """States of one press on its way down, on a coarser mesh."""

    depth: np.ndarray
    """Nominal depths [mm], shape (k,): from 0, rising."""
    states: Unknowns
    """There, one column a depth, float32."""

    @classmethod
    def of(cls, reached: Sequence[tuple[float, Unknowns]]) -> CoarsePath | None:
        """Keep states at depths above 0 [mm], each of one member; None if there are none."""
        kept = [(at, state.single()) for at, state in reached if at > 0]
        if not kept:
            return None
        parts = [kept[0][1].zeros(), *(state for _, state in kept)]
        return cls(np.array([0.0, *(at for at, _ in kept)]), Unknowns.joined(parts))

    def change(self, before: float, after: float) -> Unknowns | None:
        """Return by how much the unknowns change between two depths [mm], one column; None beyond the last state."""
        if max(before, after) > self.depth[-1] + 1e-9:
            return None
        weight = self._weights(after) - self._weights(before)
        share = torch.as_tensor(weight, dtype=torch.float32, device=self.states.u.device)[:, None]
        return Unknowns(self.states.u @ share, tuple(part @ share for part in self.states.multipliers))

    def _weights(self, depth: float) -> np.ndarray:
        """Return how much each state counts at a depth [mm]: linear between states."""
        return np.array([np.interp(depth, self.depth, one) for one in np.eye(len(self.depth))])


@dataclass(frozen=True)
class CoarseStart:
    """What a press's load steps start from: its states on a coarser mesh."""

    path: CoarsePath
    """On the coarser mesh."""
    transfer: MeshTransfer
    """To the mesh of the press."""


def changes(starts: Sequence[tuple[CoarseStart, float, float]]) -> tuple[list[int], Unknowns | None]:
    """Return the changes of presses on their mesh, float64, one column each.

    Args:
        starts: Of each press, and the depths between which it moves [mm]; all on one mesh.

    Returns:
        Which of them are known, and their changes; None if none is.
    """
    found = [(k, start.path.change(before, after)) for k, (start, before, after) in enumerate(starts)]
    known = [(k, change) for k, change in found if change is not None]
    if not known:
        return [], None
    return [k for k, _ in known], starts[0][0].transfer.fine(Unknowns.joined([change for _, change in known]))
