"""The streams of one set of files: channels, position and further quantities, each with its own clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import ColumnsEntry, Mapping, PositionEntry, SourceClock, StreamEntry
from tacdata.importing.plausibility.codes import table_without_codes, without_codes
from tacdata.importing.plausibility.repeats import without_repeats
from tacdata.importing.plausibility.resolution import restored
from tacdata.importing.plausibility.time_order import moments, spread, time_order
from tacdata.importing.plausibility.wraps import unwrapped
from tacdata.importing.source_table import INNER, SourceTable, axis, numbers, select, single, unit_of, units_of
from tacdata.importing.times import NEVER, future, times
from tacdata.importing.units import factor, quantity_of, split_unit

OTHERS = 0.3
"""Share of rows without any value of a stream from which they are rows of other streams [1]."""


@dataclass(frozen=True)
class Stream:
    """Rows of one quantity in the order of time."""

    name: str
    time_ns: np.ndarray
    """Time of each row [ns], shape (n,), int64, not decreasing."""
    values: np.ndarray
    """Values [`unit`], shape (n, k); NaN where one is missing."""
    names: tuple[str, ...]
    """Name of each column of `values`."""
    unit: str
    zero: str
    """Zero of the clock. Streams with the same zero share a clock; "aligned" fits all."""
    notes: tuple[str, ...] = ()
    assumed: bool = False
    """Whether neither the file nor the mapping gives the unit."""
    doubts: tuple[str, ...] = ()
    """Rows that were set aside or mended, as sentences."""
    stated_rate: float = 0.0
    """Rate that the source states in addition to its times [Hz]; 0 if it states none."""
    steps_back: tuple[str, ...] = ()
    """Row and size of each step back at which a stretch of the source ends, as words."""

    def chosen(self, rows: np.ndarray | slice) -> Stream:
        """Return some of the rows, by a mask or by their numbers."""
        return replace(self, time_ns=self.time_ns[rows], values=self.values[rows])

    def within(self, begin_ns: int, end_ns: int) -> Stream:
        """Return the rows from a time [ns] to before another."""
        return self.chosen(slice(*np.searchsorted(self.time_ns, (begin_ns, end_ns))))


@dataclass(frozen=True)
class ImportedStreams:
    """The streams of one set of files."""

    taxels: Stream
    """The channels; its last column is the counter if `counted`."""
    position: Stream | None
    """x, y, z of the machine [mm], or the depth below the skin as -z."""
    measured: tuple[Stream, ...] = ()
    counted: bool = False
    depth_given: bool = False
    """Whether the position is a depth, so that its zero is the skin's surface."""
    notes: tuple[str, ...] = field(default=())
    doubts: tuple[str, ...] = ()
    """Rows of any stream that were set aside or mended, as sentences."""

    @property
    def all(self) -> tuple[Stream, ...]:
        """Every stream."""
        return (self.taxels, *((self.position,) if self.position else ()), *self.measured)

    def within(self, begin_ns: int, end_ns: int) -> ImportedStreams:
        """Return the rows from a time [ns] to before another."""
        position = self.position.within(begin_ns, end_ns) if self.position else None
        measured = tuple(stream.within(begin_ns, end_ns) for stream in self.measured)
        return replace(self, taxels=self.taxels.within(begin_ns, end_ns), position=position, measured=measured)


def read_streams(
    mapping: Mapping, tables: dict[str, SourceTable], place: tuple[float, float] = (0.0, 0.0)
) -> list[ImportedStreams]:
    """Return the streams that a mapping describes, for each stretch in which time never goes back.

    Args:
        mapping: The mapping.
        tables: Name under ``files`` -> its table.
        place: x and y of the press [mm], for a position without them.

    Raises:
        FormatError: If a column, unit or clock is wrong, clocks have no zero in common, or not all of them begin again.
    """
    taxels = _taxels(mapping.taxels, tables[mapping.taxels.file])
    path = mapping.position
    position = _position(path, tables[path.file], place) if path else []
    counted, depth_given = mapping.taxels.counter is not None, path is not None and path.depth_given
    measured = [_measured(name, entry, tables[entry.file]) for name, entry in mapping.measured.items()]
    _check_stretches([taxels, *([position] if position else []), *measured])
    stretches = []
    for number, readings in enumerate(taxels):
        path, further = position[number] if position else None, tuple(streams[number] for streams in measured)
        streams = ImportedStreams(readings, path, further, counted, depth_given)
        _check_zeros(streams)
        # Of several stretches a faulty one is refused alone, and the others are imported (`presses_of`).
        if len(taxels) == 1:
            _check_overlap(streams)
        notes = tuple(note for stream in streams.all for note in stream.notes)
        doubts = tuple(dict.fromkeys(doubt for stream in streams.all for doubt in stream.doubts))
        stretches.append(replace(streams, notes=notes, doubts=doubts))
    return stretches


def _check_stretches(streams: list[list[Stream]]) -> None:
    """Refuse clocks of which some begin again and others do not: which rows belong together is then unknown.

    Raises:
        FormatError: With the row and the size of each step back.
    """
    if len({len(stretches) for stretches in streams}) > 1:
        listed = ", ".join(
            f"{stretches[0].name} {'; '.join(stretches[0].steps_back[:3]) or 'nowhere'}" for stretches in streams
        )
        raise FormatError(
            f"time goes back in some streams and not in others ({listed})",
            "clocks that begin again together, or never",
            "import the parts before and behind the step as files of their own, or leave a stream out of the mapping",
        )


def _timed(
    entry: StreamEntry,
    table: SourceTable,
    name: str,
    values: np.ndarray,
    names: tuple[str, ...],
    unit: str,
    doubts: tuple[str, ...] = (),
) -> list[Stream]:
    """Return a stream for each stretch of a file in which time never goes back."""
    clock = entry.clock
    # Wraps and restarts are recognized by the clock's own numbers: the offset follows after they are undone.
    bare = replace(clock, offset=None)
    time_ns, zero = times(table, bare, f"{name}: time")
    tick_ns = 0.0 if zero == "unix" else _tick(table, bare, time_ns, name)
    column = "time" if clock.column is None else clock.column
    where = f"{table.path.name}: {' '.join(map(str, column)) if isinstance(column, list) else column}"
    if (numbers := _clock_numbers(table, bare, name)) is not None and clock.rate is None:
        time_ns, lost = restored(numbers, time_ns, where)
        doubts = (*lost, *doubts)
    doubts = (*doubts, *future(time_ns, where)) if zero == "unix" else doubts
    zero = "aligned" if clock.offset is not None else f"own: {entry.file}" if zero == "own" else zero
    time_ns, others = _without_others(time_ns, values)
    order = time_order(time_ns, where, tick_ns=tick_ns)
    if others:
        order = replace(order, notes=tuple(note for note in order.notes if "without a time" not in note))
    stretches = []
    for rows in order.stretches:
        apart_ns, shared = spread(order.time_ns[rows] + clock.offset_ns)
        notes = [*table.notes]
        if others:
            notes.append(f"{name}: {others} rows have no value of it and one time each: they are of other streams")
        if shared:
            notes.append(
                f"{name}: {shared} of {len(rows)} rows have the time of the row before; they are spread evenly up to "
                "the next time"
            )
        stream = Stream(name, apart_ns, values[rows], names, unit, zero, tuple(notes), stated_rate=table.rate)
        all_doubts = (*table.doubts, *order.notes, *doubts)
        stretches.append(replace(stream, doubts=all_doubts, steps_back=order.steps_back))
    return stretches


def _without_others(time_ns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return times [ns] without those of rows of other streams in one table, and how many these are."""
    empty = np.isnan(values).all(axis=1)
    if not OTHERS < empty.mean() < 1:
        return time_ns, 0
    timed = int((empty & (time_ns != NEVER)).sum())
    return np.where(empty, NEVER, time_ns), timed


def _tick(table: SourceTable, clock: SourceClock, time_ns: np.ndarray, name: str) -> float:
    """Return one step of a clock's numbers [ns]; 0 where no column of numbers holds the times."""
    numbers = _clock_numbers(table, clock, name)
    if numbers is None:
        return 0.0
    valid = time_ns != NEVER
    span = float(np.ptp(numbers[valid].astype(float))) if valid.any() else 0.0
    return float(np.ptp(time_ns[valid])) / span if span > 0 else 0.0


def _clock_numbers(table: SourceTable, clock: SourceClock, name: str) -> np.ndarray | None:
    """Return the numbers of a clock as in the file, shape (rows,); None where no column of numbers holds them."""
    if not isinstance(clock.column, str | int):
        return None
    numbers = table.column(single(table, clock.column, f"{name}: time"))
    return None if numbers.dtype == object else numbers


def _taxels(entry: ColumnsEntry, table: SourceTable) -> list[Stream]:
    if entry.long:
        table, names = _widened(table, entry.clock, **entry.long)
    else:
        names = select(table, entry.columns, "taxels: columns")
    _refuse_clock(table, names, entry.clock)
    units = units_of(table, names, "taxels", entry.unit)
    unit = next(filter(None, units), "") or "as in the source"
    values, doubts = _readings(table, names, entry, "taxels")
    if several := _several(units):
        unit, doubts = "as in the source", (*doubts, f"taxels: {several}")
    values = values * entry.scale
    labels = [f"{n}[{k}]" if width else n for n in names for width in (table.inner(n),) for k in range(max(width, 1))]
    if entry.counter is not None:
        name = single(table, entry.counter, "taxels: counter")
        values = np.concatenate([values, numbers(table, [name], [], "taxels: counter")], axis=1)
    return _timed(entry, table, "taxels", values, tuple(map(_label, labels)), unit, doubts)


def _refuse_clock(table: SourceTable, names: list[str], clock: SourceClock) -> None:
    """Refuse channels among which is their own clock.

    Raises:
        FormatError: Naming it.
    """
    if isinstance(clock.column, str | int) and (time := single(table, clock.column, "time")) in names:
        raise FormatError(
            f"taxels: {time} of {table.path.name} is the time, and among the channels",
            "columns that the sensor reads",
            "correct columns under taxels in the mapping",
        )


def _readings(
    table: SourceTable, names: list[str], entry: ColumnsEntry, name: str
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return columns as numbers without codes, unless the mapping trusts them; and notes on missing values."""
    values = numbers(table, names, entry.missing, name)
    if entry.trusted:
        return values, ()
    values, wraps = unwrapped(values, name, signed=True)
    values, codes = without_codes(values, name, rails=name == "taxels" and not wraps)
    values, repeats = without_repeats(values, name)
    return values, (*wraps, *codes, *repeats)


def _several(units: list[str]) -> str:
    """Return a doubt about columns of different units; "" where they have one."""
    named = list(dict.fromkeys(filter(None, units)))
    return f"its columns have the units {', '.join(named)}, and each keeps its own" if len(named) > 1 else ""


def _label(name: str) -> str:
    """Return a channel's name without its unit; a number in brackets is no unit."""
    return name if INNER.fullmatch(name) else split_unit(name)[0]


def _widened(
    table: SourceTable, clock: SourceClock, channel: str | int, value: str | int
) -> tuple[SourceTable, list[str]]:
    """Turn a table with one row per channel into one with one column per channel; missing values are NaN."""
    if clock.column is None:
        # A rate would count rows, and here a row is one channel and not one moment.
        raise FormatError("taxels: long without a time column", "time: {column: NAME}", "add it to the mapping")
    time = single(table, clock.column, "taxels: time")
    labels_of_rows = table.column(single(table, channel, "taxels: long: channel"))
    readings = numbers(table, [single(table, value, "taxels: long: value")], [], "taxels: long")[:, 0]
    labels_of_rows = labels_of_rows.astype(str) if labels_of_rows.dtype == object else labels_of_rows
    distinct, column = np.unique(labels_of_rows, return_inverse=True)
    times_of_rows, first, row, notes = moments(times(table, clock, "taxels: time")[0], column, table.path.name)
    wide = np.full((len(times_of_rows), len(distinct)), np.nan)
    wide[row, column] = readings
    labels = [f"{k:g}" if isinstance(k, float) else str(k) for k in distinct.tolist()]
    columns = {time: table.column(time)[first], **{f"channel {label}": wide[:, k] for k, label in enumerate(labels)}}
    unit = {time: table.units[time]} if time in table.units else {}
    return SourceTable(table.path, columns, unit, notes=(*table.notes, *notes), rate=table.rate), [
        f"channel {label}" for label in labels
    ]


def _position(entry: PositionEntry, table: SourceTable, place: tuple[float, float]) -> list[Stream]:
    doubts: tuple[str, ...] = ()
    if not entry.trusted:
        # A unit would hide codes: they are found in the numbers of the file.
        selected = [single(table, each.column, "position") for each in entry.columns.values()]
        table, doubts = table_without_codes(table, selected, "position")
    axes = {"x": place[0], "y": place[1]} | entry.axes
    columns = [axis(table, axes[name], "mm", f"position: {name}", entry.missing) for name in ("x", "y")]
    down = axis(table, axes["depth" if entry.depth_given else "z"], "mm", "position: depth or z", entry.missing)
    columns.append(-down if entry.depth_given else down)
    values = np.stack(np.broadcast_arrays(*columns, np.zeros(table.rows))[:3], axis=1)
    if not entry.trusted:
        values, further = without_codes(values, "position", rails=False)
        doubts += further
    complete = np.isfinite(values).all(axis=1)
    stretches = _timed(entry, table, "position", values, ("x", "y", "z"), "mm", doubts)
    if not complete.any():
        raise FormatError("position: no row has all of its numbers", "a position", "correct the columns or missing")
    assumed = tuple(_taken_as_mm(table, entry))
    complete_rows = (np.flatnonzero(np.isfinite(stream.values).all(axis=1)) for stream in stretches)
    chosen = [stream.chosen(rows) for stream, rows in zip(stretches, complete_rows, strict=True)]
    return [replace(stream, assumed=bool(assumed), notes=(*stream.notes, *assumed)) for stream in chosen]


def _taken_as_mm(table: SourceTable, entry: PositionEntry) -> Iterator[str]:
    """Yield a remark for each column of a position whose unit neither the mapping nor the file gives."""
    for key, column in entry.columns.items():
        name = single(table, column.column, f"position: {key}")
        if not unit_of(table, name, f"position: {key}", column.unit):
            yield f"position: {name} has no unit and is taken in mm; else give unit under position/{key} in the mapping"


def _measured(name: str, entry: ColumnsEntry, table: SourceTable) -> list[Stream]:
    names = select(table, entry.columns, f"measured: {name}")
    units = units_of(table, names, f"measured: {name}", entry.unit)
    unit = next((each for each in units if each), "")
    values, doubts = _readings(table, names, entry, f"measured: {name}")
    values = values * entry.scale
    ours = {quantity_of(each) or "" for each in units if each}
    if len(ours) == 1 and (ours <= {"N", "mm"} or (name == "force" and ours != {""})):
        unit = "N" if name == "force" else ours.pop()  # a force in mm is refused
        factors = [factor(each, unit, f"measured: {name}") if each else 1.0 for each in units]
        values = values * np.repeat(factors, [max(table.inner(column), 1) for column in names])
    elif several := _several(units):
        unit, doubts = "as in the source", (*doubts, f"measured: {name}: {several}")
    # An array column expands to several, and then names and columns differ in number.
    labels = tuple(split_unit(n)[0] for n in names) if len(names) == values.shape[1] else None
    labels = labels or tuple(str(k) for k in range(values.shape[1]))
    stretches = _timed(entry, table, name, values, labels, unit, doubts)
    return [stream.chosen(np.flatnonzero(np.isfinite(stream.values).any(axis=1))) for stream in stretches]


def _check_zeros(streams: ImportedStreams) -> None:
    zeros = {stream.name: stream.zero for stream in streams.all if stream.zero != "aligned"}
    if len(set(zeros.values())) > 1:
        listed = ", ".join(f"{name}: {zero}" for name, zero in zeros.items())
        raise FormatError(
            f"clocks without a common zero ({listed})",
            "one zero for all streams, or an offset [s] that brings a clock to the others",
            "give time: {zero: ...} or time: {offset: SECONDS} in the mapping",
        )


def _check_overlap(streams: ImportedStreams) -> None:
    taxels = streams.taxels
    for stream in streams.all:
        if not len(stream.time_ns):
            if stream is taxels or stream is streams.position:
                raise FormatError(f"{stream.name}: no row", "one row or more", "correct the mapping")
            continue
        if stream.time_ns[-1] < taxels.time_ns[0] or stream.time_ns[0] > taxels.time_ns[-1]:
            spans = " and ".join(
                f"{s.name} {s.time_ns[0] / 1e9:.3f} to {s.time_ns[-1] / 1e9:.3f} s" for s in (taxels, stream)
            )
            raise FormatError(
                f"streams that do not overlap in time: {spans}",
                "streams of the same time",
                "correct the clocks' unit, zero or offset in the mapping",
            )
