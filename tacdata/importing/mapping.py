"""A mapping as a value: names of columns, units and clocks, with every default filled in."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from tacdata import provenance
from tacdata.errors import FormatError

Selector = str | int | list[Any]
"""Columns by name, by number from 0, by range or pattern, or a list of these."""


@dataclass(frozen=True)
class SourceClock:
    """The clock of a file or stream."""

    rate: float | None = None
    """Rows a second, or counts a second of `column` [Hz]."""
    column: Selector | None = None
    unit: str = ""
    format: str | None = None
    """Layout of dates, as Python's strptime has it; None: by the file."""
    zero: str = ""
    """unix, shared or own; empty: by the values."""
    offset: float | None = None
    """Added to the times [s]. With an offset, even of 0, the clock is aligned with all others."""
    drift: float = 0.0
    """Gain on the true clock [ppm]."""

    @property
    def offset_ns(self) -> int:
        """The offset [ns]; 0 without one."""
        return round((self.offset or 0.0) * 1e9)


@dataclass(frozen=True)
class Axis:
    """A column, or an expression of columns, as a quantity."""

    column: str | int = ""
    """Of an expression: the name of its values among the file's columns."""
    unit: str = ""
    """Empty: by the file's header."""
    scale: float = 1.0
    offset: float = 0.0
    """Added after the factor [mm, s or mm/s]."""
    zero: str = ""
    """The value of each trial that counts as 0: first, lowest or highest; empty: 0 itself."""
    expression: str = ""


@dataclass(frozen=True)
class KnownValue:
    """A number or a word of a trial, from the path of its files or from a column."""

    part: str = ""
    """A {part} of the path; empty: by `column`."""
    pattern: str = ""
    """Regular expression with one group, for a piece of the part."""
    file: str = ""
    """Empty: the first file of the mapping."""
    column: str | int = ""
    unit: str = ""


Quantity = float | Axis
"""A number that holds throughout, or a column."""
Value = float | KnownValue
"""A constant number, or its place in each trial."""


@dataclass(frozen=True)
class ReadOptions:
    """Options of a file's reader; a format uses those that concern it."""

    format: str = ""
    """A source format; empty: by the file's ending."""
    header: bool = True
    """Whether the first row may be a header."""
    delimiter: str = ""
    """Empty: recognized from the file, as `decimal` and `encoding`."""
    decimal: str = ""
    skip: int = 0
    """Lines to pass over at the beginning."""
    encoding: str | list[str] = ""
    """Of several the first that fits."""
    transpose: bool | None = None
    """Whether time is the second axis; None: by the shape."""
    table: str | None = None
    """Variable, sheet or topic inside the file; None: the only or the first one."""
    trial_axis: int | None = None
    """Axis of the trials in arrays of three axes."""
    missing: tuple[str, ...] = ()
    """Texts in place of no value."""


@dataclass(frozen=True)
class FileEntry:
    """One kind of file: its path and its reading."""

    paths: tuple[str, ...]
    """One pattern, or the parts of a trial in their order."""
    options: ReadOptions
    table: str | list[str] | None = None
    join: str = ""
    derived: dict[str, str] = field(default_factory=dict)
    """Name of a further column -> its expression."""
    missing: tuple[float, ...] = ()
    """Numbers in place of no value."""
    clock: SourceClock | None = None

    @classmethod
    def from_document(cls, entry: dict[str, Any]) -> Self:
        """Return the entry of a document that fits the schema."""
        path, missing = entry["path"], entry.get("missing", [])
        named = {key: entry[key] for key in ("table", "join", "derived") if key in entry}
        fields = {key: value for key, value in entry.items() if key not in ("path", "time", "missing", *named)}
        options = ReadOptions(**fields, missing=tuple(value for value in missing if isinstance(value, str)))
        # Texts are left out before a value is parsed, numbers after it.
        numbers = tuple(value for value in missing if not isinstance(value, str))
        paths = tuple(path) if isinstance(path, list) else (path,)
        return cls(paths, options, missing=numbers, clock=_clock(entry), **named)


@dataclass(frozen=True, kw_only=True)
class StreamEntry:
    """A stream of one file."""

    file: str
    clock: SourceClock
    missing: tuple[float, ...] = ()
    """Numbers in place of no value."""
    trusted: bool = False
    """Whether codes, rails, repeats, dropouts and jumps count as measured."""


@dataclass(frozen=True, kw_only=True)
class ColumnsEntry(StreamEntry):
    """A stream whose columns have one meaning: the channels, or a further quantity."""

    columns: Selector = ""
    long: dict[str, str | int] | None = None
    """Columns of the channel and its value, for files with one channel a row; in place of `columns`."""
    counter: str | int | None = None
    """Column of the device's frame counter."""
    unit: str = ""
    scale: float = 1.0
    channels_are: str = ""
    """response or effort; empty: not known."""


@dataclass(frozen=True, kw_only=True)
class PositionEntry(StreamEntry):
    """The indenter's position."""

    axes: dict[str, Quantity]
    """x, y, and either z of a machine or depth below the skin [mm]."""

    @property
    def depth_given(self) -> bool:
        """Whether the position is a depth, so that its zero is the skin's surface."""
        return "depth" in self.axes

    @property
    def columns(self) -> dict[str, Axis]:
        """The axes that are columns."""
        return {key: axis for key, axis in self.axes.items() if isinstance(axis, Axis)}


@dataclass(frozen=True)
class ListedPress:
    """One press of a schedule that a person wrote."""

    start: float
    """Beginning of the motion down, in the schedule's time [s]."""
    depth: float
    speed: float
    hold: float = 0.0
    height: float = 0.0
    x: float = 0.0
    y: float = 0.0
    release_speed: float | None = None
    """Speed up [mm/s]; None: as down."""


@dataclass(frozen=True)
class Schedule:
    """Presses by time, in place of a position: a list, or a file with a row for each."""

    presses: tuple[ListedPress, ...] = ()
    file: str = ""
    axes: dict[str, Quantity] = field(default_factory=dict)
    """start, depth, speed, release_speed, hold, height, x and y of the file."""
    clock: SourceClock = field(default_factory=SourceClock)


@dataclass(frozen=True)
class TrialRule:
    """The end of a recording in one file; at most one of the fields."""

    column: str | int | None = None
    change: str | int | None = None
    gap: float | None = None
    """Shortest pause between two trials [s]."""
    press_above: float | None = None
    """Depth of a trial [mm]."""


@dataclass(frozen=True)
class ForeignSensor:
    """The known properties of a foreign sensor; None where one is not known."""

    name: str
    columns: int | None = None
    rows: int = 1
    pitch_x: float | None = None
    pitch_y: float | None = None
    thickness: float | None = None
    size_x: float | None = None
    size_y: float | None = None
    youngs_modulus: float | None = None
    poisson_ratio: float | None = None


@dataclass(frozen=True, kw_only=True)
class Mapping:
    """A mapping of foreign files to recordings."""

    name: str
    source: str = ""
    files: dict[str, FileEntry]
    sensor: str | ForeignSensor
    """A sensor file's path, or the known properties."""
    taxels: ColumnsEntry
    position: PositionEntry | None = None
    measured: dict[str, ColumnsEntry] = field(default_factory=dict)
    schedule: Schedule | None = None
    trials: TrialRule = field(default_factory=TrialRule)
    contact: dict[str, Value] = field(default_factory=dict)
    """x, y, z and yaw of the machine where it touches the skin."""
    known_from: str = "as the mapping says"
    press: dict[str, Value] = field(default_factory=dict)
    specimen: str | KnownValue = ""
    indenter: dict[str, Any] | None = None
    """As in a plan."""
    document: dict[str, Any] = field(default_factory=dict)
    """The mapping's file."""
    folder: Path = Path()
    """Folder of the mapping, to which the sensor file's path is relative."""

    @property
    def content_hash(self) -> str:
        """SHA-256 of the document."""
        return provenance.content_hash(self.document)

    @classmethod
    def from_document(cls, document: dict[str, Any], folder: Path) -> Self:
        """Return the mapping of a document that fits `schemas/import_mapping.schema.json`.

        Args:
            document: The document.
            folder: Folder of its file.

        Raises:
            FormatError: If keys exclude each other, or a stream has no file or no clock.
        """
        files = {name: FileEntry.from_document(entry) for name, entry in document["files"].items()}
        sensor, contact, press = document["sensor"], dict(document.get("contact", {})), dict(document.get("press", {}))
        specimen = _value(press.pop("specimen", ""))
        known = {"known_from": contact.pop("known_from")} if "known_from" in contact else {}
        measured = document.get("measured", {}).items()
        position = _position(document["position"], files) if "position" in document else None
        schedule = _schedule(document["schedule"]) if document.get("schedule") else None
        return cls(
            document=document,
            folder=folder,
            name=document["name"],
            source=document.get("source", ""),
            files=_with_expressions(files, position, schedule),
            sensor=sensor if isinstance(sensor, str) else ForeignSensor(**sensor),
            taxels=_taxels(document["taxels"], files),
            position=position,
            measured={name: ColumnsEntry(**_stream(entry, files, f"measured: {name}")) for name, entry in measured},
            schedule=schedule,
            trials=TrialRule(**document.get("trials", {})),
            contact={key: _value(value) for key, value in contact.items()},
            **known,
            press={key: _value(value) for key, value in press.items()},
            specimen=specimen,
            indenter=document.get("indenter"),
        )


def _value(entry: Any) -> Any:
    return KnownValue(**entry) if isinstance(entry, dict) else entry


def _clock(entry: dict[str, Any]) -> SourceClock | None:
    return SourceClock(**entry["time"]) if entry.get("time") else None


def _stream(entry: dict[str, Any], files: dict[str, FileEntry], where: str) -> dict[str, Any]:
    """Return the fields of a stream, with the clock and the missing values of its file."""
    name = entry["file"]
    if name not in files:
        raise FormatError(f"{where}: file {name!r}", ", ".join(files), "name one under files")
    clock = _clock(entry) or files[name].clock
    if clock is None:
        raise FormatError(
            f"no clock for {name}",
            "time: {column: NAME} or time: {rate: HZ}",
            f"add time under files/{name} in the mapping",
        )
    fields = {key: value for key, value in entry.items() if key != "time"}
    return fields | {"clock": clock, "missing": (*files[name].missing, *entry.get("missing", []))}


def _taxels(entry: dict[str, Any], files: dict[str, FileEntry]) -> ColumnsEntry:
    fields = _stream(entry, files, "taxels")
    if ("long" in entry) == ("columns" in entry):
        raise FormatError("taxels with both or neither of columns and long", "one of them", "correct the mapping")
    return ColumnsEntry(**fields)


def _position(entry: dict[str, Any], files: dict[str, FileEntry]) -> PositionEntry:
    if ("depth" in entry) == ("z" in entry):
        raise FormatError("position with both or neither of z and depth", "one of them", "correct the mapping")
    fields = _stream(entry, files, "position")
    keys = [key for key in ("x", "y", "z", "depth") if key in fields]
    return PositionEntry(axes={key: _quantity(fields.pop(key), "position", key) for key in keys}, **fields)


def _schedule(entry: dict[str, Any]) -> Schedule:
    names = [key for key in entry if key not in ("presses", "file", "time")]
    axes = {key: _quantity(entry[key], "schedule", key) for key in names}
    presses = tuple(ListedPress(**press) for press in entry.get("presses", []))
    return Schedule(presses, entry.get("file", ""), axes, _clock(entry) or SourceClock())


def _quantity(entry: float | dict[str, Any], section: str, key: str) -> Quantity:
    """Return an axis; raises FormatError if it has both a column and an expression, or neither."""
    if not isinstance(entry, dict):
        return float(entry)
    if ("column" in entry) == ("expression" in entry):
        fault = f"{section}: {key} with both or neither of column and expression"
        raise FormatError(fault, "one of them", "correct the mapping")
    named: dict[str, Any] = {"column": f"{section} {key}", **entry}
    return Axis(**named)


def _with_expressions(
    files: dict[str, FileEntry], position: PositionEntry | None, schedule: Schedule | None
) -> dict[str, FileEntry]:
    """Return the files, with the expression of each axis as a derived column."""
    for section in (position, schedule):
        axes = section.axes.values() if section else ()
        # From here on an expression is a column like any other.
        further = {str(axis.column): axis.expression for axis in axes if isinstance(axis, Axis) and axis.expression}
        if section and further and section.file in files:
            entry = files[section.file]
            files = files | {section.file: replace(entry, derived=entry.derived | further)}
    return files
