"""One recording as arrays, on the host's clock and in the sensor's frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.plans import Press
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class TaxelStream:
    """Readings of the taxels, not tared."""

    arrival_ns: np.ndarray
    """Host time of receipt [ns], shape (n,), int64."""
    sample_ns: np.ndarray
    """Estimated time of sampling on the host's clock [ns], shape (n,), int64."""
    counter: np.ndarray
    """The device's frame counter [frames], shape (n,), int64."""
    counts: np.ndarray
    """Raw readings [counts], shape (n, taxels), float64."""
    device_ns: np.ndarray | None = None
    """The device's own time [ns of its clock], shape (n,), int64; -1 or None without one."""


@dataclass(frozen=True)
class CncStream:
    """Status reports of the motion controller."""

    arrival_ns: np.ndarray
    """Host time of receipt [ns], shape (m,), int64."""
    sample_ns: np.ndarray
    """Estimated time at which the position held, on the host's clock [ns], shape (m,), int64."""
    position: np.ndarray
    """Machine position [mm], shape (m, 3)."""
    state: tuple[str, ...]
    """Controller state of each report."""


@dataclass(frozen=True)
class TagStream:
    """Poses of the AprilTag cube, or of the fingertip that carries one, seen by one camera."""

    camera: str
    """Name of the camera in the rig file."""
    sample_ns: np.ndarray
    """Estimated time of exposure [ns], shape (p,), int64."""
    position: np.ndarray
    """Origin of cube or tip in the camera frame [m], shape (p, 3); NaN where no tag was seen."""
    quaternion: np.ndarray
    """Orientation of cube or tip in the camera frame, xyzw [1], shape (p, 4)."""
    reprojection: np.ndarray
    """Reprojection error, root mean square [px], shape (p,)."""
    faces: np.ndarray
    """Faces seen [count], shape (p,), int64."""
    covariance: np.ndarray | None = None
    """Covariance of a small rotation in the camera frame [rad] and the position [m], shape (p, 6, 6); NaN where
    unknown.
    """
    ambiguous: np.ndarray | None = None
    """Whether a second pose explains the image about as well, shape (p,), bool."""
    ids: tuple[tuple[int, ...], ...] = ()
    """Tags read on the cube in each image, ascending."""
    finger: str = ""
    """Name of the finger; empty for the cube that the camera's entry in the rig file names."""


@dataclass(frozen=True)
class MeasuredStream:
    """A further measured quantity: force, temperature, ..."""

    name: str
    """Its name, for example "force"."""
    unit: str
    """Unit of its values: N for forces, mm for lengths, otherwise as its source says."""
    names: tuple[str, ...]
    """Name of each of its values."""
    sample_ns: np.ndarray
    """Time of each reading [ns], shape (q,), int64; only times at which something was read."""
    values: np.ndarray
    """Readings [`unit`], shape (q, len(names)); NaN where one of several values is missing."""


@dataclass(frozen=True)
class Phase:
    """A marked stretch of the press: rest, approach, press, hold, release."""

    name: str
    """One of `PHASES`."""
    start_ns: int
    """Beginning [ns]."""
    end_ns: int
    """End [ns]."""


PHASES = ("rest", "approach", "press", "hold", "release")


@dataclass(frozen=True)
class Episode:
    """One recorded press: taxel readings, tip path, tags and everything that is attached to them.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.recording import PHASES, read_episode
        >>> episode = read_episode(Path("session/episode-000000.mcap"))
        >>> times = episode.taxels.sample_ns
        >>> round(float(episode.tip_at(times)[:, 2].max()), 3)  # largest depth, mm
        0.8
        >>> held = episode.phase_at(times) == PHASES.index("hold")
        >>> episode.taxels.counts[held].mean(axis=0).shape  # mean reading of each taxel during the hold
        (24,)
    """

    path: Path
    """The MCAP file."""
    press: Press
    """The nominal configuration."""
    sensor: Sensor
    """The sensor description attached to the recording."""
    rig: dict[str, Any]
    """The rig file's document, as attached to the recording."""
    taxels: TaxelStream
    cnc: CncStream
    tags: tuple[TagStream, ...]
    phases: tuple[Phase, ...]
    tip_ns: np.ndarray
    """Times of the commanded profile [ns], shape (k,), int64, strictly increasing."""
    tip: np.ndarray
    """Indenter's lowest point in the sensor frame: x, y and depth below the undeformed outer face [mm], shape (k, 3).

    The commanded, acceleration-limited profile anchored by the status reports; linear in between."""
    complete: bool
    """False if the recording was interrupted or salvaged."""
    notes: tuple[str, ...]
    """Remarks for a person, as sentences."""
    measured: tuple[MeasuredStream, ...] = ()
    """Further quantities, each with times of its own."""
    fingers: tuple[TagStream, ...] = ()
    """Poses of fingertips, one stream for each camera and finger."""

    @property
    def number(self) -> int:
        """The episode's number in its session."""
        return self.press.index

    def tip_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the nominal x, y, depth [mm], shape (n, 3), at times [ns], shape (n,); constant beyond both ends."""
        return np.stack([np.interp(time_ns, self.tip_ns, self.tip[:, axis]) for axis in range(3)], axis=-1)

    def phase_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the index into `PHASES` at times [ns], shape (n,), int64; -1 outside every phase."""
        result = np.full(len(time_ns), -1, dtype=np.int64)
        for phase in self.phases:
            result[(time_ns >= phase.start_ns) & (time_ns < phase.end_ns)] = PHASES.index(phase.name)
        return result
