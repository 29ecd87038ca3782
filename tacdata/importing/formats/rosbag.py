"""ROS 2 bags, MCAP and SQLite: each topic is a table of its own, at its own rate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.importing.formats.source_format import SourceFormat
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

RECEIVED = "received"
"""Column of the time at which the bag's writer got a message [ns]."""
WIDEST = 4096
"""Values of one field above which it is an image or a cloud of points, and no channel."""
MOST_PARTS = 32
"""Messages inside a message that are taken apart, such as the transforms of one TF message."""


class Rosbag(SourceFormat):
    """Fields of a topic's messages, as ``position.x``; an array of numbers becomes a table.

    The mapping names the topic (``table: /taxels``). Topics of one bag are files of the mapping with the same path,
    each with its own clock: nothing is resampled.
    """

    endings = (".mcap", ".db3")

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the topics that hold numbers."""
        with _opened(path) as reader:
            return tuple(
                topic
                for topic in _topics(reader)
                if any(np.ndim(v) or not isinstance(v, str) for _, v in _first(reader, topic))
            )

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read one topic; without ``table`` in the options the only one with numbers. See the base class."""
        with _opened(path) as reader:
            available = _topics(reader)
            topic = options.table or _only(path, self.tables(path), available)
            if topic not in available:
                raise FormatError(f"{path}: no topic {topic!r}", ", ".join(available) or "none", "correct table")
            longer: Counter[str] = Counter()
            rows = [
                (time, dict(_flat(reader.deserialize(raw, connection.msgtype), longer)))
                for connection, time, raw in reader.messages(_connections(reader, topic))
            ]
        columns, notes = _columns(rows, topic, path)
        notes += [
            f"{path.name}: {count} messages of {topic} have more than {MOST_PARTS} parts in {name}: the first "
            f"{MOST_PARTS} are taken"
            for name, count in longer.items()
        ]
        units = {name: "ns" for name in columns if name == RECEIVED or name.endswith("stamp")}
        return SourceTable(path, columns, units, notes=tuple(notes))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag: the whole of it if the file is the first of several, as its metadata.yaml lists them.

    Raises:
        FormatError: If it is a later part of a bag, or no bag of ROS 2.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    parts = _parts(path)
    if path.name in parts[1:]:
        raise FormatError(
            f"{path} is part {parts.index(path.name) + 1} of a bag of {len(parts)} files",
            f"its first file, {parts[0]}: it stands for the whole bag",
            f"name {parts[0]} in the mapping",
        )
    bag = path.parent if len(parts) > 1 else path
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield reader
    except (AnyReaderError, KeyError, AssertionError) as error:
        raise FormatError(
            f"{path} is no bag of ROS 2 that can be read: {str(error) or type(error).__name__}",
            "a bag in MCAP or SQLite, its message types described in it or standard",
            "if types are missing, record to MCAP (ros2 bag record -s mcap), or ros2 bag convert it there; a recording "
            "of tacdata needs no import, and examples/to_rosbag.py makes a bag of it",
        ) from error


def _parts(path: Path) -> list[str]:
    """Return the names of a bag's files in their order; only this one unless a metadata.yaml lists others."""
    import yaml

    described = path.parent / "metadata.yaml"
    if not described.is_file():
        return [path.name]
    try:
        listed = yaml.safe_load(described.read_text())["rosbag2_bagfile_information"]["relative_file_paths"]
        names = [Path(name).name for name in listed]
    except (yaml.YAMLError, KeyError, TypeError, ValueError):
        return [path.name]
    # A metadata.yaml of another bag in the same folder must not hide this file.
    return names if path.name in names else [path.name]


def _topics(reader: Any) -> dict[str, int]:
    """Return the topics with messages, and how many."""
    return {topic: info.msgcount for topic, info in sorted(reader.topics.items()) if info.msgcount}


def _connections(reader: Any, topic: str) -> list[Any]:
    return [connection for connection in reader.connections if connection.topic == topic]


def _first(reader: Any, topic: str) -> list[tuple[str, Any]]:
    for connection, _, raw in reader.messages(_connections(reader, topic)):
        return list(_flat(reader.deserialize(raw, connection.msgtype), Counter()))
    return []


def _only(path: Path, numeric: tuple[str, ...], available: dict[str, int]) -> str:
    if len(numeric) == 1:
        return numeric[0]
    listed = ", ".join(f"{topic} ({available[topic]} messages)" for topic in numeric)
    raise UsageError(
        f"{path} holds {len(numeric)} topics with numbers",
        listed or "topics with numbers",
        "name one under files in the mapping, such as table: " + (numeric[0] if numeric else "/taxels"),
    )


def _flat(message: Any, longer: Counter[str], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield a message's fields by their paths: numbers, texts and arrays of numbers; times in ns.

    ``longer`` counts lists of messages of which only the first `MOST_PARTS` are taken.
    """
    for field in fields(message):
        value, name = getattr(message, field.name), f"{prefix}{field.name}"
        if is_dataclass(value):
            # builtin_interfaces/Time: seconds and nanoseconds are joined as integers, which a float64 would round.
            if hasattr(value, "nanosec"):
                yield name, int(value.sec) * 1_000_000_000 + int(value.nanosec)
            else:
                yield from _flat(value, longer, f"{name}.")
        elif isinstance(value, list) and value and is_dataclass(value[0]):
            longer.update([name] if len(value) > MOST_PARTS else [])
            for number, part in enumerate(value[:MOST_PARTS]):
                yield from _flat(part, longer, f"{name}[{number}].")
        elif isinstance(value, (list, tuple)) and value and isinstance(value[0], str):
            yield name, " ".join(value)
        elif isinstance(value, str):
            yield name, value
        elif np.size(value):
            yield name, np.asarray(value) if np.ndim(value) else value


def _columns(rows: list[tuple[int, dict[str, Any]]], topic: str, path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    columns: dict[str, np.ndarray] = {RECEIVED: np.array([time for time, _ in rows], np.int64)}
    notes: list[str] = []
    for name in dict.fromkeys(name for _, row in rows for name in row):
        values = [row.get(name) for _, row in rows]
        sizes = Counter(np.size(value) for value in values if value is not None)
        width = sizes.most_common(1)[0][0]
        if width > WIDEST:
            notes.append(f"{path.name}: {topic}/{name} of {width} values a message is left out")
            continue
        if lacking := len(rows) - sizes[width]:
            fault = f"other than {width} values in {name}: no value"
            notes.append(f"{path.name}: {lacking} messages of {topic} have {fault}")
        columns[name] = _column(values, width)
    # A stamp of the sender is nearer to the measurement than the time of receipt, unless nobody set it.
    stamped = [name for name, values in columns.items() if name.endswith("stamp") and len(np.unique(values)) > 1]
    return {name: columns[name] for name in (*stamped, *(n for n in columns if n not in stamped))}, notes


def _column(values: list[Any], width: int) -> np.ndarray:
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    is_full = [value is not None and np.size(value) == width for value in values]
    if width == 1 and all(is_full) and max(abs(int(np.ravel(v)[0])) if np.isfinite(v) else 0 for v in values) > 2**53:
        return np.array([np.ravel(value)[0] for value in values], np.int64)
    table = np.array(
        [np.ravel(v).astype(float) if ok else np.full(width, np.nan) for v, ok in zip(values, is_full, strict=True)]
    )
    return table[:, 0] if width == 1 and not any(np.ndim(value) for value in values) else table
