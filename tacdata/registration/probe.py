"""Interface of a rig that the procedure needs: go to a position, and read the channels there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

Position = tuple[float, float, float]


@dataclass(frozen=True)
class StillReading:
    """Channels averaged while the indenter is at rest."""

    mean: np.ndarray
    """Mean reading [counts], shape (channels,)."""
    spread: np.ndarray
    """Standard deviation of a single reading [counts], shape (channels,)."""
    frames: int
    """Frames averaged [count]."""


class Probe(ABC):
    """Base class: an indenter on a guide over a sensor."""

    @abstractmethod
    def go(self, position: Position, speed: float) -> None:
        """Go straight to a machine position [mm] at ``speed`` [mm/s]; returns when the guide is there.

        Raises:
            DeviceError: On a fault; the motion has been stopped and the indenter lifted.
            FormatError: If the position is outside the allowed volume; nothing has moved.
        """

    @abstractmethod
    def read(self, frames: int) -> StillReading:
        """Return the mean of ``frames`` frames, all sampled after the guide came to rest."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Wait [s of the rig's clock]."""
