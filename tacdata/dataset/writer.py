"""A LeRobot v3.0 folder, written one finished episode at a time.

Order of an append: data file, record, episode row, tasks, statistics, info.json; each is written aside,
brought to the disk and renamed. info.json counts the episodes, so remains of a crash are no part of
the dataset and is replaced by the next append.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.dataset import cache
from tacdata.dataset.format import features, folder, metadata, statistics, tiff
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.dataset.format.whole_dataset import episode_table
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import Sensor


@dataclass
class DatasetWriter:
    """Appends episodes to one dataset folder. Nothing needs closing: each append is whole when it returns."""

    root: Path
    """The folder."""
    sensor: Sensor
    """The sensor of the episodes to come."""
    info: dict[str, Any]
    """Content of meta/info.json."""
    tasks: list[str] = field(default_factory=list)
    """Tasks by index."""
    stats: dict[str, statistics.Statistics] = field(default_factory=dict)
    """Statistics of the whole dataset by column."""
    recordings: set[str] = field(default_factory=set)
    """Hashes of the recordings in the dataset."""
    data_file: int = 0
    """Number of the next data file, counted through all chunks."""
    row_file: int = 0
    """Number of the next file under meta/episodes."""
    own_columns: bool = True
    """Whether rows get columns of ours: LeRobot wants the first file's in all, and its edits drop them."""

    @property
    def simulated(self) -> bool:
        """Whether its episodes are simulated presses; others are refused then."""
        return str(self.info["robot_type"]).endswith(SIMULATED)

    @classmethod
    def create(cls, root: Path, sensor: Sensor, extra: Iterable[str] = (), *, simulated: bool = False) -> DatasetWriter:
        """Start a dataset, with some of `features.EXTRA` if asked for; its folder is made by the first append.

        A simulated one has a ``robot_type`` of its own, by which LeRobot's tools refuse to merge it with recordings.

        Raises:
            UsageError: If the folder exists.
        """
        if root.exists():
            raise UsageError(
                f"{root} exists", "a folder that does not exist yet", "name another folder, or append to this dataset"
            )
        return cls(root, sensor, _empty_info(sensor, extra, simulated))

    @classmethod
    def open(
        cls, root: Path, sensor: Sensor, extra: Iterable[str] | None = None, *, simulated: bool = False
    ) -> DatasetWriter:
        """Open an existing dataset to append episodes of ``sensor`` to it.

        Args:
            root: The folder.
            sensor: Whose episodes.
            extra: Optional columns of `features.EXTRA` it must have; None takes those present.
            simulated: Whether a dataset that has no finished episode yet is to hold simulated ones.

        Raises:
            UsageError: If there is none.
            FormatError: If it is damaged, lost its sensor description, or has other columns than episodes of
                this sensor.
        """
        if not (root / folder.INFO).exists() and (root / metadata.MAIN).exists():
            # The very first append never finished: nothing counts yet.
            return cls(root, sensor, _empty_info(sensor, extra or (), simulated))
        info = folder.read_info(root)
        main = metadata.read_main(root)
        if main is None:
            raise metadata.lost(root)
        _same_columns(root, info, sensor, extra)
        rows = folder.read_rows(root, info)
        if sensor.content_hash not in main["sensors"]:
            metadata.write_main(root, {**main["sensors"], sensor.content_hash: sensor.document}, main["rate"])
        keys = _record_keys(cache.data_files(root, rows), info)
        recordings = {record.recording for key, record in metadata.read_records(root).items() if key in keys}
        return cls(
            root,
            sensor,
            info,
            folder.read_tasks(root),
            folder.read_row_stats(root, info),
            recordings,
            1 + max((row.data_file for row in rows), default=-1),
            1 + max((row.row_file for row in rows), default=-1),
            folder.row_columns(root) >= set(OWN_COLUMNS),
        )

    def append(self, columns: dict[str, np.ndarray], record: EpisodeRecord, task: str) -> int:
        """Append one episode and bring it to the disk; a first one that is broken off leaves no folder.

        Args:
            columns: Every column of `features.DTYPES` but the two hashes, and those of `features.EXTRA` that the
                dataset has, frames first, in the units of `features.unit`; shapes as `features.shapes`.
            record: Where the episode comes from.
            task: Description of the task.

        Returns:
            The episode's index.

        Raises:
            UsageError: If the dataset holds this recording already.
            FormatError: If columns are missing, of the wrong shape, or not finite.
        """
        fresh = not self.root.exists()
        try:
            return self._append(columns, record, task)
        except BaseException:
            if fresh and not (self.root / folder.INFO).exists():
                shutil.rmtree(self.root, ignore_errors=True)
            raise

    def _append(self, columns: dict[str, np.ndarray], record: EpisodeRecord, task: str) -> int:
        if record.recording in self.recordings:
            raise UsageError(f"{self.root} holds {record.recording_file} already", "each episode once", "leave it out")
        if self.simulated != (record.simulated is not None):
            content, addition = (
                ("simulated presses", "was recorded") if self.simulated else ("recordings", "is simulated")
            )
            raise UsageError(
                f"{self.root} holds {content}, {record.recording_file} {addition}",
                "recordings and simulated presses in datasets of their own",
                "name another folder",
            )
        if record.sensor != self.sensor.content_hash:
            raise FormatError(
                f"{record.recording_file} is of sensor {record.sensor[:8]}",
                f"sensor {self.sensor.content_hash[:8]} ({self.sensor.name})",
                "pack each sensor with a writer of its own",
            )
        frames = _check(columns, self.sensor, features.extra_of(self.info["features"]), record.recording_file)
        episode, first = self.info["total_episodes"], self.info["total_frames"]
        tasks = self.tasks if task in self.tasks else [*self.tasks, task]
        frame_columns = {
            **{key: features.cast(key, values) for key, values in columns.items()},
            features.SENSOR: np.full(frames, features.short_hash(record.sensor)),
            features.RECORD: np.full(frames, record.key),
            # LeRobot wants even times; the true ones have a column of their own.
            "timestamp": (np.arange(frames) / self.info["fps"]).astype(np.float32),
            "frame_index": np.arange(frames),
            "episode_index": np.full(frames, episode),
            "index": np.arange(first, first + frames),
            "task_index": np.full(frames, tasks.index(task)),
        }
        # LeRobot takes float depth for metres: millimetres are stored a thousandth.
        frame_columns[features.DEPTH] = frame_columns[features.DEPTH] / tiff.MM_PER_METRE
        if not episode:
            metadata.write_main(self.root, {record.sensor: self.sensor.document}, self.sensor.taxels.rate)
        stats = {key: statistics.column_statistics(frame_columns[key]) for key in self.info["features"]}
        self._write_files(frame_columns, stats, record, tasks, task)
        self.stats = {
            key: statistics.merge([self.stats[key], new]) if key in self.stats else new for key, new in stats.items()
        }
        folder.write_stats(self.root, self.stats)
        self.info |= {
            "total_episodes": episode + 1,
            "total_frames": first + frames,
            "total_tasks": len(tasks),
            "splits": {"train": f"0:{episode + 1}"},
        }
        # Last: until info.json counts the episode, a crash leaves only files that nobody reads.
        documents.write_text(self.root / folder.INFO, json.dumps(self.info, indent=4))
        self.tasks, self.data_file, self.row_file = tasks, self.data_file + 1, self.row_file + 1
        self.recordings.add(record.recording)
        return episode

    def _write_files(
        self,
        frame_columns: dict[str, np.ndarray],
        stats: dict[str, statistics.Statistics],
        record: EpisodeRecord,
        tasks: list[str],
        task: str,
    ) -> None:
        stamp = {metadata.SHARD_KEY: metadata.shard_metadata(self.sensor, record)}
        table = episode_table(frame_columns, self.info["features"], stamp)
        folder.write_parquet(self.root / folder.data_path(self.data_file), table)
        metadata.append_record(self.root, record)
        row = folder.EpisodeRow(
            index=self.info["total_episodes"],
            start=self.info["total_frames"],
            stop=self.info["total_frames"] + len(frame_columns["index"]),
            tasks=(task,),
            data_file=self.data_file,
            row_file=self.row_file,
        )
        folder.write_row(self.root, row, stats, _own(record) if self.own_columns else {})
        if len(tasks) > len(self.tasks):
            folder.write_tasks(self.root, tasks)


SIMULATED = "-simulated"
"""Ending of a simulated dataset's ``robot_type``."""
OWN_COLUMNS = ("tacdata/sensor", "tacdata/recording", "tacdata/label", "tacdata/indenter", "tacdata/quality")


def _empty_info(sensor: Sensor, extra: Iterable[str], simulated: bool) -> dict[str, Any]:
    robot = f"{sensor.name}{SIMULATED if simulated else ''}"
    return folder.empty_info(features.lerobot_features(sensor, extra), sensor.taxels.rate, robot)


def _own(record: EpisodeRecord) -> dict[str, Any]:
    """Return the columns of an episode's row that `episode_filter` can choose by."""
    return {
        "tacdata/sensor": record.sensor,
        "tacdata/recording": record.recording,
        "tacdata/label": record.label,
        "tacdata/indenter": str(record.press["indenter"]["shape"]),
        "tacdata/quality": record.quality,
    }


def _record_keys(paths: list[Path], info: dict[str, Any]) -> set[int]:
    """Return the record keys of the counted frames."""
    keys: set[int] = set()
    for path in paths:
        table = folder.read_parquet(path, ["index", features.RECORD])
        # Frames beyond are of an append that was broken off.
        counted = table["index"].to_numpy() < info["total_frames"]
        keys.update(np.unique(table[features.RECORD].to_numpy()[counted]).tolist())
    return keys


def _same_columns(root: Path, info: dict[str, Any], sensor: Sensor, extra: Iterable[str] | None) -> None:
    present = features.extra_of(info["features"])
    if extra is not None and set(extra) != set(present):
        raise UsageError(
            f"{root} holds {', '.join(present) or 'no columns beyond the usual'}, asked for are "
            f"{', '.join(extra) or 'none'}",
            "the same columns in all episodes of a dataset",
            "ask for the columns that it has, or pack into a new folder",
        )
    for key, feature in features.lerobot_features(sensor, present).items():
        have = info["features"].get(key, {})
        if (have.get("dtype"), have.get("shape")) != (feature["dtype"], feature["shape"]):
            raise FormatError(
                f"{root}: {key} is {have.get('dtype')} {have.get('shape')}",
                f"{feature['dtype']} {feature['shape']} as sensor {sensor.name!r} needs",
                "pack this sensor's episodes into a dataset of their own",
            )


def _check(columns: dict[str, np.ndarray], sensor: Sensor, extra: tuple[str, ...], origin: str) -> int:
    expected = {k: v for k, v in features.shapes(sensor, extra).items() if k not in (features.SENSOR, features.RECORD)}
    if set(columns) != set(expected):
        difference = sorted(set(columns) ^ set(expected))
        raise FormatError(
            f"{origin}: {', '.join(difference)} missing or unknown", ", ".join(expected), "correct the columns"
        )
    frames = len(columns[features.TIME])
    for key, shape in expected.items():
        values = columns[key]
        if values.shape != (frames, *shape) or frames == 0:
            raise FormatError(
                f"{origin}: {key} has shape {values.shape}",
                f"({max(frames, 1)}, {', '.join(map(str, shape))}) for sensor {sensor.name!r}",
                "check that recording, label and sensor file belong together",
            )
        if not np.isfinite(values).all():
            raise FormatError(
                f"{origin}: {key} holds values that are not finite (first in frame "
                f"{int(np.argwhere(~np.isfinite(values.reshape(frames, -1)))[0, 0])})",
                "finite values",
                "leave this episode out, or record or label it again",
            )
    return frames
