"""Every equilibrium that presses pass, requested or not: derivatives along a load path need them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from tacdata.skin.solve.configuration import Configuration
from tacdata.skin.solve.equilibrium import Equilibrium


@dataclass(frozen=True)
class Passage:
    """A state that was wanted, and all equilibria that led to it."""

    depth: float
    """Nominal depth [mm]."""
    state: Equilibrium
    """With displacements."""
    reached: tuple[Configuration, ...]
    """The equilibria since the wanted state before, each of one member; the first of a press is the touch."""


class PathRecorder:
    """Observer of `Batch.run` that keeps every equilibrium, press by press; the first is the touch, without load."""

    def __init__(self) -> None:
        """Start empty."""
        self._reached: dict[int, list[Configuration]] = {}

    def __call__(self, numbers: Sequence[int], reached: Configuration) -> None:
        """Keep an equilibrium of each of some presses, one a column."""
        for column, number in enumerate(numbers):
            state = reached.take(torch.tensor([column], device=reached.u.device))
            self._reached.setdefault(number, []).append(state)

    def take(self, number: int) -> tuple[Configuration, ...]:
        """Return the equilibria of a press since the last call."""
        return tuple(self._reached.pop(number, ()))
