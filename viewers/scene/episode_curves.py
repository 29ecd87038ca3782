"""Readings of an episode, measured and predicted by a model before and after a revision."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EpisodeCurves:
    """Readings of one episode; rows without a reading are left out."""

    name: str
    time: np.ndarray
    """Since its first row [s], shape (n,)."""
    depth: np.ndarray
    """Commanded depth [mm], shape (n,)."""
    measured: np.ndarray
    """Measured readings [the source's unit], shape (n, channels)."""
    before: np.ndarray
    """Predicted readings, shifted by a constant to the episode's measured median [the source's unit], shape (n,
    channels).
    """
    after: np.ndarray
    """The same with the effects [the source's unit], shape (n, channels)."""
    noise: np.ndarray
    """Standard deviation of a reading's noise [the source's unit], shape (channels,)."""
    channels: tuple[str, ...]
    """Name of each channel, by its number in the recordings."""

    @property
    def channel_name(self) -> str:
        """Name of that channel."""
        return self.channels[self.channel]

    @property
    def channel(self) -> int:
        """The channel in which the effects change most."""
        return int(np.argmax(np.square(self.after - self.before).mean(axis=0) / self.noise**2))
