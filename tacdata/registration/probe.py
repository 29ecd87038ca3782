"""What the procedure needs of a rig: to go somewhere, and to read the channels while standing there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

Position = tuple[float, float, float]


@dataclass(frozen=True)
class StillReading:
    """Channels while the indenter stands still."""

    mean: np.ndarray
    """Mean reading [counts], shape (channels,)."""
    spread: np.ndarray
    """Standard deviation of a single reading [counts], shape (channels,)."""
    frames: int
    """Readings behind the mean."""


class Probe(ABC):
    """An indenter on a guide over a sensor."""

    @abstractmethod
    def go(self, position: Position, speed: float) -> None:
        """Go straight to a machine position [mm] at ``speed`` [mm/s]; returns when the guide stands there.

        Raises:
            DeviceError: On a fault; the motion has been stopped and the indenter lifted.
            FormatError: If the position is outside what is allowed; nothing has moved.
        """

    @abstractmethod
    def read(self, frames: int) -> StillReading:
        """Return the mean of so many frames, all sampled after the guide came to rest."""

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Let so much time pass [s of the rig's clock]."""
