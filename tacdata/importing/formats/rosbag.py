"""Bags of ROS 1 and 2, and MCAP of other writers: each topic is a table of its own, at its own rate."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

RECEIVED, SENT = "received", "sent"
"""Columns of the times at which the writer got a message, and at which its sender sent it [ns]."""
WIDEST = 4096
"""Values of one field above which it is an image or a cloud of points, and no channel."""
MOST_PARTS = 32
"""Messages inside a message that are taken apart, such as the transforms of one TF message."""
TYPE = "__msgtype__"
"""Field in which Python's messages hold the name of their type."""
STAMPS = ({"sec", "nanosec"}, {"sec", "nsec"}, {"secs", "nsecs"}, {"seconds", "nanos"})
"""Names of the parts of a time in ROS 2, JSON, ROS 1 and protobuf."""
OWN = "tacdata"
"""Profile of a recording of tacdata."""


class Rosbag(SourceFormat):
    """Fields of a topic's messages, as ``position.x``; an array of numbers becomes a table.

    The mapping names the topic (``table: /taxels``). Topics of one bag are files of the mapping with the same path,
    each with its own clock: nothing is resampled.
    """

    endings = (".mcap", ".db3", ".bag")

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the topics that hold numbers."""
        with _opened(path) as log:
            return tuple(
                topic
                for topic in log.counts
                if any(np.ndim(v) or not isinstance(v, str) for _, v in _first(log, topic))
            )

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read one topic; without ``table`` in the options the only one with numbers. See the base class."""
        with _opened(path) as log:
            topic = options.table or _only(path, self.tables(path), log.counts)
            if topic not in log.counts:
                raise FormatError(f"{path}: no topic {topic!r}", ", ".join(log.counts) or "none", "correct table")
            longer: Counter[str] = Counter()
            rows = [times | dict(_flat(message, longer)) for times, message in log.messages(topic)]
        columns, notes = _columns(rows, topic, path)
        notes += [
            f"{path.name}: {count} messages of {topic} have more than {MOST_PARTS} parts in {name}: the first "
            f"{MOST_PARTS} are taken"
            for name, count in longer.items()
        ]
        units = {name: "ns" for name in columns if name in (RECEIVED, SENT) or name.endswith("stamp")}
        return SourceTable(path, columns, units, notes=tuple(notes), doubts=tuple(log.doubts))


class _RosLog:
    """A bag of ROS 1 or 2 as rosbags reads it."""

    doubts = ()

    def __init__(self, reader: Any) -> None:
        self.reader = reader
        self.counts = {topic: info.msgcount for topic, info in sorted(reader.topics.items()) if info.msgcount}
        """Topics with messages, and how many."""

    def messages(self, topic: str) -> Iterator[tuple[dict[str, Any], Any]]:
        """Yield the times and the content of a topic's messages."""
        connections = [connection for connection in self.reader.connections if connection.topic == topic]
        for connection, time, raw in self.reader.messages(connections):
            yield {RECEIVED: time}, self.reader.deserialize(raw, connection.msgtype)


@dataclass
class _McapLog:
    """An MCAP file of any writer as it lies there, with a summary or without."""

    path: Path
    rows: dict[str, list[tuple[int, int, Any, bytes]]] = field(default_factory=dict)
    """Topic -> time of receipt and of sending [ns], encoding and type, content."""
    doubts: list[str] = field(default_factory=list)
    """Parts that are lost or not read, as sentences."""

    @property
    def counts(self) -> dict[str, int]:
        """Topics with messages, and how many."""
        return {topic: len(rows) for topic, rows in sorted(self.rows.items()) if rows}

    def read(self) -> _McapLog:
        """Read the messages of every encoding that is known.

        Raises:
            FormatError: If there are none, with the encodings and compressions of the file.
        """
        from rosbags.typesys import Stores, get_typestore

        self.types = get_typestore(Stores.EMPTY)
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        unknown: dict[str, set[str]] = {}
        for record in self._records(unknown):
            match type(record).__name__:
                case "Header" if record.profile == OWN:
                    raise _unreadable(self.path, "it is a recording of tacdata")
                case "Schema":
                    schemas[record.id] = record
                case "Channel" if record.id not in channels:
                    schema = schemas.get(record.schema_id)
                    channels[record.id] = (record.topic, self._kind(record.message_encoding, schema))
                    if channels[record.id][1] is None:
                        named = f"messages in {record.message_encoding or 'an encoding without a name'}"
                        unknown.setdefault(named, set()).add(record.topic)
                case "Message":
                    topic, kind = channels.get(record.channel_id, ("", None))
                    if kind is not None:
                        row = (record.log_time, record.publish_time, kind, record.data)
                        self.rows.setdefault(topic, []).append(row)
        words = [f"{what} ({', '.join(sorted(topics))})" if topics else what for what, topics in unknown.items()]
        if not self.rows and words:
            raise FormatError(
                f"{self.path} holds {'; '.join(words)}",
                "messages in JSON or of ROS 1 or 2, chunks in zstd, lz4 or uncompressed",
                "convert it with the program that wrote it, to JSON or to a table",
            )
        self.doubts += [f"{self.path.name}: not read: {each}" for each in words]
        return self

    def messages(self, topic: str) -> Iterator[tuple[dict[str, Any], Any]]:
        """Yield the times and the content of a topic's messages, in the order of receipt."""
        # An MCAP file may hold messages in the order of arrival at the disk.
        rows = sorted(self.rows[topic], key=lambda row: row[:2])
        differ = any(received != sent for received, sent, _, _ in rows)
        for received, sent, kind, data in rows:
            yield {RECEIVED: received} | ({SENT: sent} if differ else {}), self._content(kind, data)

    def _kind(self, encoding: str, schema: Any) -> tuple[str, str] | None:
        """Return the encoding and type of a channel's messages, whose description is kept; None for an unknown one."""
        from rosbags.typesys import get_types_from_idl, get_types_from_msg

        if encoding == "json":
            return encoding, ""
        if encoding not in ("cdr", "ros1") or schema is None:
            return None
        if schema.encoding not in ("ros1msg", "ros2msg", "ros2idl"):
            return None
        text, is_idl = schema.data.decode(), schema.encoding == "ros2idl"
        self.types.register(get_types_from_idl(text) if is_idl else get_types_from_msg(text, schema.name))
        package, _, name = schema.name.rpartition("/")
        return encoding, schema.name if package.endswith("/msg") else f"{package}/msg/{name}"

    def _content(self, kind: tuple[str, str], data: bytes) -> Any:
        encoding, name = kind
        if encoding == "json":
            content = json.loads(data)
            return content if isinstance(content, dict) else {"data": content}
        return self.types.deserialize_cdr(data, name) if encoding == "cdr" else self.types.deserialize_ros1(data, name)

    def _records(self, unknown: dict[str, set[str]]) -> Iterator[Any]:
        """Yield the records, those in chunks as well. Chunks that are damaged, or cut off, are counted."""
        from mcap.records import Chunk
        from mcap.stream_reader import MAGIC_SIZE, StreamReader, breakup_chunk

        damaged, size = 0, 0
        with self.path.open("rb") as stream:
            records = iter(StreamReader(stream, emit_chunks=True).records)
            while True:
                try:
                    record = next(records)
                except StopIteration:
                    break
                except Exception:  # a file that is cut off or overwritten raises anything
                    if stream.tell() <= MAGIC_SIZE:
                        raise
                    self.doubts.append(
                        f"{self.path.name}: it is cut off or damaged near byte {stream.tell():,} of "
                        f"{self.path.stat().st_size:,}: what follows is lost"
                    )
                    break
                if not isinstance(record, Chunk):
                    yield record
                    continue
                if record.compression not in ("", "lz4", "zstd"):
                    unknown.setdefault(f"chunks in the compression {record.compression}", set())
                    continue
                size += record.uncompressed_size
                refuse_growth(self.path, size)
                try:
                    inside = breakup_chunk(record, validate_crc=True)
                except Exception:
                    damaged += 1
                    continue
                yield from inside
        if damaged:
            self.doubts.append(
                f"{self.path.name}: {damaged} chunk{'s are' * (damaged > 1) or ' is'} damaged: its messages are missing"
            )


@contextmanager
def _opened(path: Path) -> Iterator[_RosLog | _McapLog]:
    """Open a bag: the whole of it if the file is the first of several, as its metadata.yaml lists them.

    Raises:
        FormatError: If it is a later part of a bag, or no bag of ROS.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    parts = _parts(path)
    if path.name in parts[1:]:
        raise FormatError(
            f"{path} is part {parts.index(path.name) + 1} of a bag of {len(parts)} files",
            f"its first file, {parts[0]}: it is read as the whole bag",
            f"name {parts[0]} in the mapping",
        )
    try:
        if path.suffix == ".mcap" and len(parts) == 1:
            yield _McapLog(path).read()
            return
        bag = path.parent if len(parts) > 1 else path
        with AnyReader([bag], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield _RosLog(reader)
    except (AnyReaderError, KeyError, AssertionError) as error:
        raise _unreadable(path, str(error) or type(error).__name__) from error


def _unreadable(path: Path, reason: str) -> FormatError:
    return FormatError(
        f"{path} is no bag of ROS that can be read: {reason}",
        "a bag of ROS 1 or 2, its message types described in it or standard, or MCAP with messages in JSON",
        "if types are missing, record to MCAP (ros2 bag record -s mcap), or ros2 bag convert it there; a recording "
        "of tacdata needs no import, and examples/to_rosbag.py makes a bag of it",
    )


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


def _first(log: _RosLog | _McapLog, topic: str) -> list[tuple[str, Any]]:
    return next(([*_flat(message, Counter())] for _, message in log.messages(topic)), [])


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
    for key, value in _parts_of(message).items():
        name = f"{prefix}{key}"
        if inside := _parts_of(value):
            # Times of ROS and of JSON: seconds and nanoseconds are joined as integers, which a float64 would round.
            if set(inside) in STAMPS:
                second, fraction = (int(inside[part]) for part in sorted(inside, key=lambda part: "n" in part[0]))
                yield name, second * 1_000_000_000 + fraction
            else:
                yield from _flat(value, longer, f"{name}.")
        elif isinstance(value, list) and value and _parts_of(value[0]):
            longer.update([name] if len(value) > MOST_PARTS else [])
            for number, part in enumerate(value[:MOST_PARTS]):
                yield from _flat(part, longer, f"{name}[{number}].")
        elif isinstance(value, (list, tuple)) and value and isinstance(value[0], str):
            yield name, " ".join(value)
        elif isinstance(value, str):
            yield name, value
        elif value is not None and np.size(value):
            yield name, np.asarray(value, float if isinstance(value, list) else None) if np.ndim(value) else value


def _parts_of(message: Any) -> dict[str, Any]:
    """Return the fields of a message, or of an object in JSON; none of a plain value."""
    if isinstance(message, dict):
        return message
    if not is_dataclass(message):
        return {}
    return {each.name: getattr(message, each.name) for each in fields(message) if each.name != TYPE}


def _columns(rows: list[dict[str, Any]], topic: str, path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    columns: dict[str, np.ndarray] = {}
    notes: list[str] = []
    for name in dict.fromkeys(name for row in rows for name in row):
        values = [row.get(name) for row in rows]
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
    stamps = [name for name in columns if name.endswith("stamp")] + [SENT] * (SENT in columns)
    stamped = [name for name in stamps if len(np.unique(columns[name])) > 1]
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
