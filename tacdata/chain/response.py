"""Start of a chain: loads on the channels by the pose of the tip alone, without memory."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from tacdata.chain.course import Course

FAR = 1e4
"""Largest rise of all channels, over the largest reading of one: beyond it, that channel has a unit of its own [1]."""


class Response(ABC):
    """A response without memory: pose to loads, loads to readings."""

    fitted = False
    """Whether it was fitted to the recordings that are judged; then only effects with memory can be judged."""
    form_error = 0.0
    """Share of an effect's contribution that may be model error through this response, root of squares [1]."""

    error = 0.0
    """Root mean square of its numerical error, over that of the loads [1]; 0 where none is stated."""

    @property
    def spacing(self) -> float | None:
        """Largest distance between successive depths that were solved [mm]; None where none were."""
        return None

    @abstractmethod
    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the load on each channel, shape (n, channels); 0 without contact.

        Args:
            pose: x, y, depth of the tip [mm], shape (n, 3).
            tool: Index of the tool, shape (n,), int64.
        """

    @abstractmethod
    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the normal force [N, or in arbitrary units where none is known], shape (n,)."""

    @abstractmethod
    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return the readings of loads, shape (n, channels)."""

    def largest(self, signal: np.ndarray) -> np.ndarray:
        """Return the largest rise of all readings above those in the air: the unit of some effects' sizes.

        It is the same for all channels, unless their units are far apart: shape (channels,).

        Args:
            signal: Readings of all rows, shape (n, channels).
        """
        largest = np.abs(signal - self.signal(np.zeros_like(signal[:1]))).max()
        reach = np.abs(signal).max(axis=0)
        return np.where(reach > 0, np.minimum(largest, FAR * reach), largest)

    def swing(self, signal: np.ndarray) -> np.ndarray:
        """Return the range of each channel's readings: the unit of a friction that no elastic load comes with.

        Args:
            signal: Readings of all rows, shape (n, channels).

        Returns:
            Of each row's place, in the readings' unit, shape (n, channels), or (1, channels) where all are equal.
        """
        return np.ptp(signal, axis=0, keepdims=True)

    def rougher(self) -> Response | None:
        """Return the same response with a coarser interpolation, by which numerics are judged; None without one."""
        return None

    def features(self, course: Course) -> np.ndarray | None:
        """Return columns of pose alone that the response could be corrected by, shape (n, k); None for none."""
        return None
