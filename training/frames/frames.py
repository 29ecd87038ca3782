"""Input of the trainer: every labelled frame in flat arrays, and which episode it belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import FormatError
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class EpisodeSpan:
    """One episode's place in the flat arrays, and its nominal contact."""

    number: int
    """The episode's number in the dataset."""
    start: int
    """First frame."""
    stop: int
    """One past the last frame."""
    indenter: str
    """The plan's name for the indenter."""
    shape: str
    """The indenter's shape: a file name in tacdata/indenters."""
    x: float
    """Nominal contact centre [mm, sensor frame]."""
    y: float
    """Nominal contact centre [mm, sensor frame]."""
    depth: float
    """Largest nominal depth of the indenter's lowest point [mm]."""
    speed: float | None = None
    """Loading speed [mm/s]; None if the dataset does not say."""
    specimen: str = ""
    """Which of several sensors of one design: the name in its sensor file, else the rig's; empty if not known."""
    purpose: str = ""
    """Purpose of the press in the plan."""


@dataclass(frozen=True)
class Frames:
    """All frames of a dataset, episode after episode."""

    taxels: np.ndarray
    """Tared readings [counts], shape (n, taxels), float32."""
    depth: np.ndarray
    """Label: depth map [mm], shape (n, pixels_x, pixels_y), float32, not negative."""
    tip: np.ndarray
    """Nominal x, y and depth of the indenter's lowest point [mm], shape (n, 3), float32."""
    phase: np.ndarray
    """Index into `tacdata.recording.episode.PHASES` [1], shape (n,), int64; -1 outside every phase."""
    time_ns: np.ndarray
    """Estimated sampling time [ns], shape (n,), int64."""
    valid: np.ndarray
    """The frame may be learned from and scored [bool], shape (n,); the others still stand in windows."""
    episodes: tuple[EpisodeSpan, ...]
    """Whole episodes in the order of their frames."""
    sensor: Sensor
    """The sensor that all frames are of."""
    dataset_hash: str
    """Identity of the dataset's content."""
    origin: str
    """Path of the dataset, as given; for messages."""
    virtual: bool | None = None
    """True if a virtual rig recorded it, False if a real one did, None if the dataset does not say."""
    simulated: bool = False
    """Whether nobody recorded them: `tacdata simulate` made some or all of the episodes."""
    taxel_force: np.ndarray | None = None
    """Normal force on each protrusion by the skin model [N], shape (n, taxels); None if not known."""

    def __post_init__(self) -> None:
        """Refuse arrays that no network may see.

        Raises:
            FormatError: If shapes, the sensor and each other disagree, or a value is not finite.
        """
        n = len(self.taxels)
        self._check_shape("taxel signals", self.taxels, (n, self.sensor.taxels.count), "a channel is missing or added")
        self._check_shape("label maps", self.depth, (n, *self.sensor.map.shape), "the map is of another sensor")
        self._check_shape("nominal tip", self.tip, (n, 3), "the tip column is damaged")
        self._check_shape("phases", self.phase, (n,), "the phase column is damaged")
        self._check_shape("times", self.time_ns, (n,), "the time column is damaged")
        self._check_shape("validity flags", self.valid, (n,), "the column is damaged")
        if not self.episodes or [e.start for e in self.episodes] != [0, *(e.stop for e in self.episodes[:-1])]:
            raise FormatError(f"{self.origin}: episodes do not follow each other", "gapless spans", "pack it again")
        if self.episodes[-1].stop != n or any(e.stop <= e.start for e in self.episodes):
            raise FormatError(
                f"{self.origin}: {n} frames, episodes end at {self.episodes[-1].stop}",
                "at least one frame an episode, and none outside",
                "pack it again",
            )
        for name, values in (("taxel signals", self.taxels), ("label maps", self.depth), ("nominal tip", self.tip)):
            self._check_finite(name, values)

    def _check_shape(self, name: str, values: np.ndarray, expected: tuple[int, ...], why: str) -> None:
        if values.shape != expected:
            raise FormatError(
                f"{self.origin}: {name} have shape {values.shape}",
                f"{expected} for sensor {self.sensor.name} ({why})",
                "pack the dataset with the sensor file that it was recorded with",
            )

    def _check_finite(self, name: str, values: np.ndarray) -> None:
        for span in self.episodes:
            part = values[span.start : span.stop]
            if not np.isfinite(part).all():
                frame = int(np.argwhere(~np.isfinite(part).reshape(len(part), -1).all(axis=1))[0, 0])
                raise FormatError(
                    f"{self.origin}: {name} of episode {span.number}, frame {frame} are not finite",
                    "finite numbers only",
                    "leave that episode out, or record and label it again",
                )

    def spans(self, numbers: tuple[int, ...]) -> tuple[EpisodeSpan, ...]:
        """Return the episodes of the given numbers, in dataset order.

        Raises:
            FormatError: If one of them is not in the dataset.
        """
        present = {e.number for e in self.episodes}
        missing = sorted(set(numbers) - present)
        if missing:
            raise FormatError(
                f"{self.origin} lacks episodes {missing}",
                "every episode of the split",
                "use the dataset that the network was trained on",
            )
        requested = set(numbers)
        return tuple(e for e in self.episodes if e.number in requested)

    def indices(self, numbers: tuple[int, ...]) -> np.ndarray:
        """Return the valid frames of the given episodes, ascending, shape (m,), int64.

        Raises:
            FormatError: If there is none, or an episode is not in the dataset.
        """
        inside = np.zeros(len(self.taxels), dtype=bool)
        for span in self.spans(numbers):
            inside[span.start : span.stop] = True
        indices = np.flatnonzero(inside & self.valid)
        if not len(indices):
            raise FormatError(
                f"{self.origin}: none of {inside.sum()} frames of episodes {list(numbers)} is valid",
                "at least one valid frame",
                "record these episodes again, or leave them out",
            )
        return indices
