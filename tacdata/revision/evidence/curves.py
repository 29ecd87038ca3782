"""Measured readings of a few episodes, and those that the model predicts before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.effects import Placed
from tacdata.revision.comparison import Comparison


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
    """Predicted readings, shifted by a constant to the episode's measured mean [the source's unit], shape (n,
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

    def rms_error(self, predicted: np.ndarray) -> float:
        """Return the root mean square difference from the measurement [the source's unit]."""
        return float(np.sqrt(np.mean(np.square(predicted - self.measured))))


def curves(held: Comparison, placed: Sequence[Placed], episodes: np.ndarray, most: int = 3) -> list[EpisodeCurves]:
    """Return the episodes in which the effects change most, largest change first."""
    after = held.after(placed)
    predicted_before = held.predicted(held.before.response, [])
    predicted_after = held.predicted(after.response, after.placed)
    course, scale = held.course, held.null.noise.scale[: held.course.channels]
    change = np.square((predicted_after - predicted_before) / scale).mean(axis=1)
    order = sorted(episodes.tolist(), key=lambda e: -float(change[course.episode == e].mean()))[:most]
    found = []
    for e in order:
        rows = np.flatnonzero((course.episode == e) & (course.averaged > 0))
        measured = course.readings[rows]

        # A constant per episode belongs to the calibration: both predictions are shifted to the measured mean.
        def level(predicted: np.ndarray, rows: np.ndarray = rows, measured: np.ndarray = measured) -> np.ndarray:
            own = predicted[rows]
            return own + (measured - own).mean(axis=0)

        time = course.time[rows] - course.time[rows[0]]
        found.append(
            EpisodeCurves(
                course.names[e],
                time,
                course.tip[rows, 2],
                measured,
                level(predicted_before),
                level(predicted_after),
                scale,
                course.channel_names,
            )
        )
    return found
