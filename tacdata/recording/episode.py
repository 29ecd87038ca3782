"""One recording as arrays, on the host's clock and in the sensor's frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata.display import Displayed
from tacdata.errors import FormatError, PackageError
from tacdata.labels import Label, file_names, read_label
from tacdata.plans import Press
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    import pandas


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
    timing: np.ndarray | None = None
    """Standard uncertainty of each time of exposure [s], shape (p,); None where a stream has one for all."""


@dataclass(frozen=True)
class MeasuredStream:
    """A further measured quantity: force, temperature, ..."""

    name: str
    """Its name, for example "force"."""
    unit: str
    """Unit of its values: N for forces, mm for lengths, otherwise as in its source."""
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


@dataclass(frozen=True, repr=False)
class Episode(Displayed):
    """One recorded press: taxel readings, tip path, tags and everything that is attached to them.

    Example:
        >>> import tacdata as td
        >>> episode = td.read_episode("session/episode-000000.mcap")
        >>> episode.tared.shape, round(float(episode.times[-1]), 1)  # frames and taxels; seconds
        ((170, 24), 5.6)
        >>> times = episode.taxels.sample_ns
        >>> round(float(episode.tip_at(times)[:, 2].max()), 3)  # largest depth, mm
        0.8
        >>> table = episode.to_pandas()
        >>> [phase for phase in table["phase"].unique() if phase]
        ['rest', 'approach', 'press', 'hold', 'release']
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

    def __fspath__(self) -> str:
        """Return the file: functions that take a path take the object, too."""
        return str(self.path)

    @property
    def number(self) -> int:
        """The episode's number in its session."""
        return self.press.index

    @property
    def readings(self) -> np.ndarray:
        """Raw readings of the taxels [counts], shape (n, taxels), float64."""
        return self.taxels.counts

    @property
    def baseline(self) -> np.ndarray:
        """Mean reading of each taxel in the rest phase [counts], shape (taxels,).

        Raises:
            FormatError: If no frame is in the rest phase, so that the readings cannot be tared.
        """
        resting = self.phase_at(self.taxels.sample_ns) == PHASES.index("rest")
        if not resting.any():
            raise FormatError(
                f"{self.path.name}: no taxel frame lies in the rest phase",
                "at least one frame without contact, to tare with",
                "record with a longer rest (motion/rest in the plan)",
            )
        return self.taxels.counts[resting].mean(axis=0)

    @property
    def tared(self) -> np.ndarray:
        """Readings minus their `baseline` [counts], shape (n, taxels), float64; raises as `baseline`."""
        return self.readings - self.baseline

    @property
    def on_path(self) -> np.ndarray:
        """Whether each reading is within the time of the commanded path, shape (n,), bool; False without a path."""
        times = self.taxels.sample_ns
        if not len(self.tip_ns):
            return np.zeros(len(times), bool)
        return (times >= self.tip_ns[0]) & (times <= self.tip_ns[-1])

    @property
    def times(self) -> np.ndarray:
        """Estimated time of each reading since the first [s], shape (n,)."""
        return (self.taxels.sample_ns - self.taxels.sample_ns[:1]) / 1e9

    @property
    def depth(self) -> np.ndarray:
        """Nominal depth of the tip at each reading [mm], shape (n,); NaN where no path is known."""
        if not len(self.tip_ns):
            return np.full(len(self.times), np.nan)
        return self.tip_at(self.taxels.sample_ns)[:, 2]

    @cached_property
    def label(self) -> Label | None:
        """The label in the folder ``labels`` next to the recording; None without one.

        Raises:
            FormatError: If its file is damaged.
        """
        path = file_names.label(file_names.folder(self.path.parent), self.path)
        return read_label(path) if path.is_file() else None

    def to_pandas(self) -> pandas.DataFrame:
        """Return a table with one row a reading: time [s], phase, tip x, y, depth [mm], raw readings [counts].

        Raises:
            PackageError: If pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise PackageError("a table needs pandas, which is not installed", "pandas", "pip install pandas") from None
        phase = self.phase_at(self.taxels.sample_ns)
        x, y, depth = self.tip_at(self.taxels.sample_ns).T if len(self.tip_ns) else np.full((3, len(phase)), np.nan)
        taxels = {f"taxel_{k}": self.readings[:, k] for k in range(self.readings.shape[1])}
        names = [PHASES[index] if index >= 0 else "" for index in phase]
        return pandas.DataFrame({"time_s": self.times, "phase": names, "x": x, "y": y, "depth": depth, **taxels})

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: press, readings, label."""
        frames, taxels = self.readings.shape
        yield f"Episode {self.path.name}: {self.press}"
        seconds = self.times[-1] if frames else 0.0
        yield f"sensor {self.sensor.name}, {frames} readings of {taxels} taxels in {seconds:.1f} s"
        streams = [f"{len(self.cnc.sample_ns)} motion reports", *(f"camera {tags.camera}" for tags in self.tags)]
        yield ", ".join([*streams, *(stream.name for stream in self.measured)])
        # Without reading the label, whose maps are large.
        labelled = file_names.label(file_names.folder(self.path.parent), self.path).is_file()
        yield "labelled" if labelled else "not labelled"
        if not self.complete:
            yield "incomplete: the recording was interrupted"

    def tip_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the nominal x, y, depth [mm], shape (n, 3), at times [ns], shape (n,); constant beyond both ends."""
        return np.stack([np.interp(time_ns, self.tip_ns, self.tip[:, axis]) for axis in range(3)], axis=-1)

    def phase_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the index into `PHASES` at times [ns], shape (n,), int64; -1 outside every phase."""
        result = np.full(len(time_ns), -1, dtype=np.int64)
        for phase in self.phases:
            result[(time_ns >= phase.start_ns) & (time_ns < phase.end_ns)] = PHASES.index(phase.name)
        return result
