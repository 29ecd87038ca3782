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
        states = [(at, state.single()) for at, state in reached if at > 0]
        if not states:
            return None
        # The undeformed skin is the state at depth 0.
        parts = [states[0][1].zeros(), *(state for _, state in states)]
        return cls(np.array([0.0, *(at for at, _ in states)]), Unknowns.joined(parts))

    def change(self, start: float, end: float) -> Unknowns | None:
        """Return by how much the unknowns change between two depths [mm], one column; None beyond the last state."""
        if max(start, end) > self.depth[-1] + 1e-9:
            return None
        weight = self._weights(end) - self._weights(start)
        share = torch.as_tensor(weight, dtype=torch.float32, device=self.states.u.device)[:, None]
        return Unknowns(self.states.u @ share, tuple(part @ share for part in self.states.multipliers))

    def _weights(self, depth: float) -> np.ndarray:
        """Return how much each state counts at a depth [mm]: linear between states."""
        return np.array([np.interp(depth, self.depth, unit) for unit in np.eye(len(self.depth))])


@dataclass(frozen=True)
class CoarseStart:
    """Start of a press's load steps: its states on a coarser mesh."""

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
    candidates = [
        (k, start.path.change(start_depth, end_depth)) for k, (start, start_depth, end_depth) in enumerate(starts)
    ]
    available = [(k, change) for k, change in candidates if change is not None]
    if not available:
        return [], None
    return [k for k, _ in available], starts[0][0].transfer.fine(Unknowns.joined([change for _, change in available]))
