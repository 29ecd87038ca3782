"""The files of a LeRobot v3.0 folder: their names, columns and metadata."""

import json
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents
from tacdata.dataset.format.statistics import STATISTICS, Statistics, merge
from tacdata.errors import FormatError, UsageError
from tacdata.replacement import replacement

CODEBASE_VERSION, OLDER, OLDEST = "v3.0", "v2.1", "v2.0"
FILES_PER_CHUNK = 1000
INFO, STATS, TASKS = Path("meta/info.json"), Path("meta/stats.json"), Path("meta/tasks.parquet")


@dataclass(frozen=True)
class EpisodeRow:
    """LeRobot's metadata of one episode: a row of meta/episodes."""

    index: int
    """Episode number, from 0."""
    start: int
    """First frame in the dataset."""
    stop: int
    """One past its last frame."""
    tasks: tuple[str, ...]
    """Description of its task."""
    data_file: int
    """Number of its data file, counted through all chunks."""
    row_file: int
    """Number of the file that holds this row, counted through all chunks."""


def _numbered(parent: str, number: int) -> Path:
    chunk, file = divmod(number, FILES_PER_CHUNK)
    return Path(f"{parent}/chunk-{chunk:03d}/file-{file:03d}.parquet")


def data_path(number: int) -> Path:
    """Return the path of a data file relative to the dataset."""
    return _numbered("data", number)


def row_path(number: int) -> Path:
    """Return a file of episode rows as a path relative to the dataset."""
    return _numbered("meta/episodes", number)


def empty_info(features: dict[str, Any], rate: float, robot: str) -> dict[str, Any]:
    """Return info.json of a dataset without episodes; ``rate`` [Hz] is rounded: LeRobot wants an integer."""
    return {
        "codebase_version": CODEBASE_VERSION,
        "fps": max(round(rate), 1),
        "features": features,
        "total_episodes": 0,
        "total_frames": 0,
        "total_tasks": 0,
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "robot_type": robot,
        "splits": {},
    }


def read_info(root: Path) -> dict[str, Any]:
    """Read meta/info.json.

    Raises:
        UsageError: If the folder or the file does not exist.
        FormatError: If it is unreadable or of another LeRobot version.
    """
    if not (root / INFO).is_file():
        raise UsageError(
            f"no dataset in {root}: {INFO} is missing" if root.is_dir() else f"no folder {root}",
            "a LeRobot v3.0 folder written by `tacdata pack`",
            "check the path, or run `tacdata pack`",
        )
    try:
        info = json.loads((root / INFO).read_text())
        version = info["codebase_version"]
        if isinstance(info["fps"], float) and info["fps"].is_integer():
            info["fps"] = int(info["fps"])  # JSON knows no difference between 30 and 30.0
        complete = all(isinstance(info[key], int) for key in ("fps", "total_episodes", "total_frames"))
        complete = complete and isinstance(info["features"], dict) and bool(info["data_path"])
    except (ValueError, KeyError, TypeError) as error:
        raise FormatError(
            f"{root / INFO} is unreadable: {error!r}", "LeRobot's info.json", "pack the session again"
        ) from None
    if isinstance(info["fps"], float):
        raise FormatError(
            f"{root / INFO}: {info['fps']:g} frames a second",
            "a whole number of frames a second, as LeRobot has it",
            "write the rate that the timestamps have as a whole number, or pack the session again",
        )
    if not complete or str(version).split(".")[0] != CODEBASE_VERSION.split(".")[0]:
        raise FormatError(
            f"{root / INFO}: LeRobot format {version}" if complete else f"{root / INFO} lacks counts or features",
            f"LeRobot format {CODEBASE_VERSION}",
            _converted(root, version) if complete else "convert it with lerobot, or pack the session again",
        )
    return info


def _converted(root: Path, version: str) -> str:
    """Return the commands of lerobot that bring a folder of a version before to the present one."""
    if version == OLDEST:
        return (
            "first to v2.1 by lerobot 0.3, which has python -m lerobot.datasets.v21.convert_dataset_v20_to_v21, "
            f"then {_converted(root, OLDER)}"
        )
    if version != OLDER:
        return "convert it with lerobot, or pack the session again"
    name = quote(f"local/{root.resolve().name}")
    options = f"--repo-id={name} --root={quote(str(root))} --push-to-hub=false"
    return f"python -m lerobot.scripts.convert_dataset_v21_to_v30 {options}  (the extra learn brings it)"


def write_parquet(path: Path, table: pa.Table) -> None:
    """Write a Parquet file under a temporary name, sync it, rename it."""
    with replacement(path) as stream:
        # Only a checksum finds bits that have flipped on the disk.
        pq.write_table(table, stream, compression="snappy", write_page_checksum=True)


def write_row(root: Path, row: EpisodeRow, stats: dict[str, Statistics], extra: dict[str, Any]) -> None:
    """Write a file of meta/episodes with one row: LeRobot's columns, the statistics, and ``extra`` columns."""
    columns = {
        "episode_index": row.index,
        "tasks": list(row.tasks),
        "length": row.stop - row.start,
        "data/chunk_index": row.data_file // FILES_PER_CHUNK,
        "data/file_index": row.data_file % FILES_PER_CHUNK,
        "dataset_from_index": row.start,
        "dataset_to_index": row.stop,
        **{f"stats/{key}/{name}": value.tolist() for key, values in stats.items() for name, value in values.items()},
        "meta/episodes/chunk_index": row.row_file // FILES_PER_CHUNK,
        "meta/episodes/file_index": row.row_file % FILES_PER_CHUNK,
        **extra,
    }
    write_parquet(root / row_path(row.row_file), pa.Table.from_pydict({key: [value] for key, value in columns.items()}))


def row_columns(root: Path) -> set[str]:
    """Return the columns of the first file of meta/episodes.

    Raises:
        FormatError: If it is damaged.
    """
    first = min((root / "meta/episodes").glob("*/*.parquet"))
    return set(read_parquet(first).column_names)


def rows_in(path: Path) -> dict[int, EpisodeRow]:
    """Return the rows of one file of meta/episodes, by the episode's number.

    Raises:
        FormatError: If it is damaged.
    """
    places = [f"{part}/{level}_index" for part in ("data", "meta/episodes") for level in ("chunk", "file")]
    fields = ["episode_index", "tasks", "dataset_from_index", "dataset_to_index", *places]
    return {
        entry["episode_index"]: EpisodeRow(
            entry["episode_index"],
            entry["dataset_from_index"],
            entry["dataset_to_index"],
            tuple(entry["tasks"]),
            entry["data/chunk_index"] * FILES_PER_CHUNK + entry["data/file_index"],
            entry["meta/episodes/chunk_index"] * FILES_PER_CHUNK + entry["meta/episodes/file_index"],
        )
        for entry in read_parquet(path, fields).to_pylist()
    }


def read_rows(root: Path, info: dict[str, Any]) -> list[EpisodeRow]:
    """Return the rows of the episodes that info.json counts, in order; remains of a crash are ignored.

    Raises:
        FormatError: If rows are missing, damaged, or do not follow each other.
    """
    rows: dict[int, EpisodeRow] = {}
    for path in sorted((root / "meta/episodes").glob("*/*.parquet")):
        rows |= rows_in(path)
    ordered = [rows[index] for index in range(info["total_episodes"]) if index in rows]
    gapless = [row.start for row in ordered] == [0, *(row.stop for row in ordered[:-1])] if ordered else True
    frames = ordered[-1].stop if ordered else 0
    if len(ordered) != info["total_episodes"] or not gapless or frames != info["total_frames"]:
        raise FormatError(
            f"{root}: meta/episodes describes {len(ordered)} episodes ending at frame {frames}",
            f"{info['total_episodes']} gapless episodes of {info['total_frames']} frames, as {INFO} counts",
            "put the missing file back, or pack the session again",
        )
    return ordered


def read_parquet(path: Path, columns: list[str] | None = None) -> pa.Table:
    """Read a Parquet file of the dataset.

    Raises:
        FormatError: If it is damaged or lacks a column.
    """
    remedy = "put the original file back, or pack the session again: the recordings hold everything"
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read(columns)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(f"{path} is damaged or was never finished: {reason}", "a Parquet file", remedy) from None
    missing = sorted(set(columns or ()) - set(table.column_names))
    if missing:
        raise FormatError(f"{path} lacks {', '.join(missing)}", "the columns that tacdata writes", remedy)
    return table


def write_tasks(root: Path, tasks: list[str]) -> None:
    """Write meta/tasks.parquet, which LeRobot reads by pandas as a frame with the index ``task``."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    described = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    write_parquet(root / TASKS, table.replace_schema_metadata({"pandas": json.dumps(described)}))


def read_tasks(root: Path) -> list[str]:
    """Return the tasks by index.

    Raises:
        FormatError: If the file is damaged.
    """
    table = read_parquet(root / TASKS)
    # pandas names the index as it likes after an edit.
    name = next((c for c in table.column_names if c != "task_index"), "task")
    pairs = sorted(zip(table["task_index"].to_pylist(), table[name].to_pylist(), strict=True))
    return [str(task) for _, task in pairs]


def write_stats(root: Path, stats: dict[str, Statistics]) -> None:
    """Write meta/stats.json."""
    content = {key: {name: value.tolist() for name, value in values.items()} for key, values in stats.items()}
    documents.write_text(root / STATS, json.dumps(content))


def read_row_stats(root: Path, info: dict[str, Any]) -> dict[str, Statistics]:
    """Return the dataset's statistics, merged from the rows of counted episodes.

    Raises:
        FormatError: If a file is damaged.
    """
    parts: dict[str, list[Statistics]] = {}
    for path in sorted((root / "meta/episodes").glob("*/*.parquet")):
        for entry in read_parquet(path).to_pylist():
            # Remains of an append that was broken off.
            if entry["episode_index"] >= info["total_episodes"]:
                continue
            for key in info["features"]:
                values = {name: entry.get(f"stats/{key}/{name}") for name in ("count", *STATISTICS)}
                if all(value is not None for value in values.values()):
                    parts.setdefault(key, []).append({k: np.atleast_1d(v) for k, v in values.items()})
    return {key: merge(values) for key, values in parts.items()}


def huggingface_metadata(features: dict[str, Any]) -> bytes:
    """Return the Parquet schema metadata by which the ``datasets`` library recognizes images."""
    described: dict[str, Any] = {}
    for key, feature in features.items():
        value = {"dtype": feature["dtype"], "_type": "Value"}
        if feature["dtype"] == "image":
            described[key] = {"_type": "Image"}
        elif feature["shape"] == [1]:
            described[key] = value
        else:
            described[key] = {"feature": value, "length": feature["shape"][0], "_type": "List"}
    return json.dumps({"info": {"features": described}}).encode()
