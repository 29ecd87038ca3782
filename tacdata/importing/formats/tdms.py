"""TDMS files of LabVIEW: channels of one group, of one length and step, are a table."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.importing.formats.hdf5 import chosen_table, columns_of, tables_of
from tacdata.importing.formats.npz import rows_of
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

START, STEP, UNITS = "wf_start_time", "wf_increment", ("unit_string", "NI_UnitDescription", "unit")
"""Properties of a channel: time of its first value, time between two values [s], and its unit."""
EPOCH = np.datetime64("1904-01-02")
"""Times before it are those that nobody set."""


class Tdms(SourceFormat):
    """Channels by name, in the unit that their properties state; of several tables one is named by ``table``.

    A waveform has no channel of time: a column ``time`` holds its start and steps.
    """

    endings = (".tdms",)

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the tables, if there are several; see the base."""
        with _opened(path) as channels:
            tables = tables_of(channels)
        return tuple(tables) if len(tables) > 1 else ("",)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the channels of a table, scaled as LabVIEW shows them. See the base class."""
        with _opened(path) as channels:
            tables = tables_of(channels)
            members = tables.get(chosen_table(path, list(tables), options), [])
            columns, clock = columns_of(members), channels[members[0]] if members else _Clock(0)
            refuse_growth(path, 8.0 * clock.rows * len(members))
            arrays = {column: _values(channels[key]) for key, column in columns.items()}
            units = {column: channels[key].unit for key, column in columns.items() if channels[key].unit}
            lost = sum(channels[key].rows - len(channels[key].channel) for key in members)
        notes = [f"{path.name}: it was cut while it was written; {lost} values are missing"] * bool(lost)
        if clock.step and not any(values.dtype.kind == "M" for values in arrays.values()):
            elapsed, start = np.arange(clock.rows) * clock.step, clock.start
            time = elapsed if start is None else start + (elapsed * 1e9).astype("timedelta64[ns]")
            arrays, units = {"time": time, **arrays}, {"time": "s", **units}
            origin = f", from {START}" * (start is not None)
            notes.append(f"{path.name}: time is made of {STEP}, {clock.step:g} s{origin}")
        table = rows_of(path, arrays, options)
        return replace(table, units={**units, **table.units}, notes=(*notes, *table.notes))


@dataclass(frozen=True)
class _Clock:
    """Rows of a channel and their times. Channels with equal ones are of one table."""

    rows: int
    """Number of rows, those that a cut took included."""
    step: float = 0.0
    """Time between two values of a waveform [s]; 0 for other channels."""
    start: Any = None
    """Time of a waveform's first value; None if nobody set it."""
    channel: Any = field(default=None, compare=False)
    unit: str = field(default="", compare=False)


@contextmanager
def _opened(path: Path) -> Iterator[dict[str, _Clock]]:
    """Give a file's channels with values, by group and name."""
    from nptdms import TdmsFile

    logging.getLogger("nptdms").setLevel(logging.ERROR)  # what it warns of is told below
    with path.open("rb") as stream, TdmsFile.open(stream) as file:
        cut = file.file_status.channel_statuses or {}
        yield {
            "/".join(name.replace("/", "_") for name in (group.name, channel.name)): _clock(channel, cut)
            for group in file.groups()
            for channel in group.channels()
            if len(channel) > 1
        }


def _clock(channel: Any, cut: dict[str, Any]) -> _Clock:
    """Return a channel's clock; ``cut`` has the lengths of those whose end is missing."""
    properties, ending = channel.properties, cut.get(channel.path)
    rows = len(channel) + (ending.expected_length - ending.read_length if ending else 0)
    unit = next((str(properties[name]) for name in UNITS if properties.get(name)), "")
    step = properties.get(STEP, 0.0)
    if not isinstance(step, float) or step <= 0 or properties.get("wf_xunit_string", "s") not in ("", "s"):
        return _Clock(rows, channel=channel, unit=unit)
    start, offset = properties.get(START), round(1e9 * float(properties.get("wf_start_offset", 0.0)))
    is_set = isinstance(start, np.datetime64) and start > EPOCH
    start = start.astype("datetime64[ns]") + np.timedelta64(offset, "ns") if is_set else None
    return _Clock(rows, step, start, channel, unit)


def _values(clock: _Clock) -> np.ndarray:
    """Return a channel's values, NaN where a cut took them."""
    values = np.asarray(clock.channel[:])
    lost = clock.rows - len(values)
    return np.append(values.astype(float), np.full(lost, np.nan)) if lost and values.dtype.kind in "biuf" else values
