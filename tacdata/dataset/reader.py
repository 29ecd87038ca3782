"""Read a dataset folder: columns as memory maps, episodes with their provenance, the sensor, the units."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from tacdata.dataset import cache
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.display import Displayed
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.plans import Press
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    from tacdata.dataset.windows import WindowDataset


class LostProvenanceWarning(UserWarning):
    """A tool that edited the dataset dropped part of its provenance."""


@dataclass(frozen=True)
class DatasetEpisode:
    """One episode of a dataset."""

    index: int
    """Number in the dataset, from 0."""
    start: int
    """First frame."""
    stop: int
    """One past the last frame."""
    task: str
    """Description of its task."""
    sensor: str
    """Content hash of its sensor."""
    record: EpisodeRecord | None
    """Where it comes from; None if an edit lost it."""

    @property
    def press(self) -> Press | None:
        """The nominal configuration; None if an edit lost it."""
        return self.record.configuration if self.record else None


@dataclass(frozen=True, repr=False)
class Dataset(Displayed):
    """A dataset on disk. ``dataset[key]`` is a column, frames first, in the units of `units`."""

    root: Path
    """The folder."""
    columns: dict[str, np.ndarray]
    """Column by name (`tacdata.dataset.format.features`), read-only memory maps."""
    episodes: tuple[DatasetEpisode, ...]
    """Episodes in order; their frames follow each other without gaps."""
    sensors: dict[str, Sensor]
    """Sensor by content hash."""
    fps: int
    """Frames a second as LeRobot counts them: the nominal rate, rounded [Hz]."""
    content_hash: str
    """Identity of the content (hex, 64 characters)."""

    def __len__(self) -> int:
        """Number of frames."""
        return self.episodes[-1].stop

    def __getitem__(self, key: str) -> np.ndarray:
        """Return a column.

        Raises:
            FormatError: If there is none of that name.
        """
        if key not in self.columns:
            raise FormatError(f"{self.root} has no column {key!r}", ", ".join(self.columns), "name one of them")
        return self.columns[key]

    def __fspath__(self) -> str:
        """Return the folder: functions that take a path take the object, too."""
        return str(self.root)

    def windows(
        self, offsets: Mapping[str, Iterable[int]] | None = None, keys: Sequence[str] | None = None
    ) -> WindowDataset:
        """Return the frames with windows around them as a torch dataset, for a DataLoader.

        Args:
            offsets: Column -> frames of its window relative to the frame asked for; None takes the paper's nine around
                it for the tared readings. Columns not named here give the one frame.
            keys: Columns to return; None returns all.

        Raises:
            FormatError: If a column is not in the dataset.
        """
        from tacdata.dataset.windows import WindowDataset

        return WindowDataset(self, offsets, keys)

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: episodes, frames, sensors, columns."""
        simulated = f", {self.simulated} of them simulated" if self.simulated else ""
        yield f"Dataset {self.root}: {len(self.episodes)} episodes{simulated}, {len(self)} frames at {self.fps} Hz"
        yield f"sensor {', '.join(sensor.name for sensor in self.sensors.values())}"
        yield f"columns {', '.join(self.columns)}"

    @property
    def units(self) -> dict[str, str]:
        """Unit of every column."""
        return {key: features.unit(key) for key in self.columns}

    @cached_property
    def simulated(self) -> int:
        """Number of episodes that nobody recorded (`tacdata simulate`)."""
        return sum(episode.record is not None and episode.record.simulated is not None for episode in self.episodes)

    def check_measured(self, purpose: str) -> None:
        """Refuse a dataset with simulated episodes where measured ones are meant.

        Args:
            purpose: Purpose, for the message.

        Raises:
            UsageError: If it has one.
        """
        if self.simulated:
            raise UsageError(
                f"{self.root}: {self.simulated} of {len(self.episodes)} episodes are simulated, nobody measured them",
                f"recorded presses, for {purpose}",
                "record a session, label and pack it, and name that dataset",
            )

    @cached_property
    def sensor(self) -> Sensor:
        """The sensor, where all episodes share one.

        Raises:
            FormatError: If they are of several sensors.
        """
        used = {episode.sensor for episode in self.episodes}
        if len(used) != 1:
            raise FormatError(
                f"{self.root} holds episodes of {len(used)} sensors", "one sensor", "use `sensors` and `episodes`"
            )
        return self.sensors[used.pop()]


def read_dataset(root: StrPath, cache_folder: StrPath | None = None) -> Dataset:
    """Open a dataset folder, also one that lerobot's own tools have edited.

    The first call after a change decodes the data files into memory maps (`tacdata.dataset.cache`); later
    ones only map them. Datasets may be larger than memory.

    Args:
        root: The folder.
        cache_folder: Where the maps lie; None takes the user's cache.

    Raises:
        UsageError: If there is no dataset.
        FormatError: If it is damaged, foreign, or does not say which sensor recorded it.

    Warns:
        LostProvenanceWarning: If an edit dropped metadata that is dispensable or recoverable.

    Example:
        >>> import tacdata as td
        >>> dataset = td.read_dataset("dataset", "cache")
        >>> len(dataset.episodes), dataset.fps
        (2, 30)
        >>> dataset["observation.state"].shape  # frames, taxels
        (340, 24)
        >>> dataset.units["observation.state"]
        'counts'
    """
    root = Path(root)
    info = folder.read_info(root)
    _check_columns(root, info)
    rows = folder.read_rows(root, info)
    if not rows:
        raise FormatError(f"{root} holds no episodes", "at least one", "pack a session into it")
    paths = cache.data_files(root, rows)
    place = cache.place_of(root, None if cache_folder is None else Path(cache_folder))
    digest = cache.dataset_hash(root, info, paths, place)
    columns = cache.open_columns(root, info, paths, place, digest)
    sensors, records = _provenance(root, paths)
    # Frames carry the first 60 bits, which fit a column of integers.
    by_key = {features.short_hash(full): full for full in sensors}
    episodes = []
    for row in rows:
        key = _single(root, columns[features.SENSOR], row, "sensors")
        if key not in by_key:
            raise FormatError(
                f"{root}: episode {row.index} is of sensor {key:015x}, which {metadata.MAIN} lacks",
                ", ".join(f"{k:015x} ({sensors[full].name})" for k, full in by_key.items()),
                "tacdata dataset restore, with the dataset that this episode comes from; or tacdata dataset delete",
            )
        record = records.get(_single(root, columns[features.RECORD], row, "records"))
        episodes.append(DatasetEpisode(row.index, row.start, row.stop, " / ".join(row.tasks), by_key[key], record))
    nameless = [episode.index for episode in episodes if episode.record is None]
    if nameless:
        _warn(
            f"{root}: {len(nameless)} of {len(episodes)} episodes (first: {nameless[0]}) lost their records; "
            f"tacdata dataset restore finds their records in the dataset that this one was made from"
        )
    return Dataset(root, columns, tuple(episodes), sensors, info["fps"], digest)


def _warn(text: str) -> None:
    warnings.warn(text, LostProvenanceWarning, stacklevel=3)


def _check_columns(root: Path, info: dict[str, Any]) -> None:
    missing = [key for key in (*features.DTYPES, *features.INDEX_COLUMNS) if key not in info["features"]]
    if missing:
        raise FormatError(
            f"{root} is a LeRobot dataset without {', '.join(missing)}",
            "a dataset that `tacdata pack` wrote",
            "name such a dataset; others have no labels to train on",
        )
    for key in (*features.UNITS, *features.extra_of(info["features"])):
        # LeRobot's depth maps are in metres; `read_dataset` gives millimetres.
        stored = "m" if key == features.DEPTH else features.unit(key)
        unit = (info["features"][key].get("info") or {}).get("unit", stored)
        if unit != stored:
            raise FormatError(f"{root}: {key} is in {unit}", stored, "convert the column, or pack the session again")


def _provenance(root: Path, paths: list[Path]) -> tuple[dict[str, Sensor], dict[int, EpisodeRecord]]:
    """Return sensors and records, from meta/ or, where an edit dropped them, from the data files."""
    main, records = metadata.read_main(root), metadata.read_records(root)
    documents = main["sensors"] if main else {}
    if main is None or not records:
        stamps = _shard_stamps(paths)
        if not documents and stamps:
            _warn(f"{root}: {metadata.MAIN} is gone; the sensor is taken from the data files")
        documents = documents or {stamp["sensor_hash"]: stamp["sensor"] for stamp in stamps}
        entries = [EpisodeRecord.from_document(stamp["record"], str(root)) for stamp in stamps]
        records = records or {record.key: record for record in entries}
    if not documents:
        raise metadata.lost(root)
    sensors = {digest: Sensor.from_document(document, str(root)) for digest, document in documents.items()}
    # Frames know only the hash: a changed description would pass for the recorded one.
    if any(sensor.content_hash != digest for digest, sensor in sensors.items()):
        raise FormatError(f"{root}: a sensor description was changed", "it as recorded", "put the original back")
    return sensors, records


def _shard_stamps(paths: list[Path]) -> list[dict[str, Any]]:
    stamps = ((pq.read_schema(path).metadata or {}).get(metadata.SHARD_KEY) for path in paths)
    return [json.loads(stamp) for stamp in stamps if stamp]


def _single(root: Path, column: np.ndarray, row: folder.EpisodeRow, what: str) -> int:
    values = np.unique(column[row.start : row.stop])
    if len(values) != 1:
        raise FormatError(f"{root}: episode {row.index} mixes {len(values)} {what}", "one", "pack the session again")
    return int(values[0])
