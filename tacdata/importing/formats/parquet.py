"""Parquet and Feather tables."""

import re
from ast import literal_eval
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.importing.text.layout import are_units

IN_FILE, FIRST = b"ARROW1", b"FEA1"
"""First bytes of Arrow's file format and of the first Feather; its stream format has none."""
LEVELS = re.compile(r"\(('[^'\\]*'|\d+)(, ('[^'\\]*'|\d+))+\)")
"""Name of a column with several levels."""


class Parquet(SourceFormat):
    """Columns of an Arrow table; a list column becomes a table of its own."""

    endings = (".parquet", ".feather", ".arrow", ".ipc")

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read all columns; nulls become NaN. See the base."""
        import pyarrow as pa
        from pyarrow import feather, parquet

        if path.suffix != ".parquet":
            with path.open("rb") as stream:
                in_file = stream.read(len(IN_FILE)).startswith((IN_FILE, FIRST))
            table = feather.read_table(path) if in_file else pa.ipc.open_stream(path).read_all()
        else:
            file = parquet.ParquetFile(path)
            # Every value takes the 8 bytes of a float64.
            refuse_growth(path, 8.0 * file.metadata.num_rows * file.metadata.num_columns)
            table = file.read()
        # `flatten` opens one level of nesting.
        while any(pa.types.is_struct(field.type) for field in table.schema):
            table = table.flatten()
        levels = [_levels(str(name)) for name in table.column_names]
        names = [name for name, _ in levels]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            places = ", ".join(
                f"{name} in columns {' and '.join(str(k) for k, n in enumerate(names) if n == name)}" for name in twice
            )
            raise FormatError(
                f"{path}: columns of the same name: {places}", "each name once", "rename one, and save it again"
            )
        notes: list[str] = []
        columns = {name: _column(table.column(k), f"{path.name}: {name}", notes) for k, name in enumerate(names)}
        units = {name: unit for name, unit in levels if unit} | {
            field.name: field.metadata[key].decode()
            for field in table.schema
            for key in (b"unit", b"units")
            if field.metadata and key in field.metadata
        }
        typed = {field.name: str(field.type.unit) for field in table.schema if pa.types.is_duration(field.type)}
        typed |= {field.name: "ns" for field in table.schema if pa.types.is_timestamp(field.type)}
        return SourceTable(path, columns, units | typed, frozenset(typed), tuple(notes))


def _levels(name: str) -> tuple[str, str]:
    """Return the name and the unit in a name of several levels, as pandas writes ('force', 'mN')."""
    parts = [str(part) for part in literal_eval(name) if part] if LEVELS.fullmatch(name) else [name]
    unit = parts.pop() if len(parts) > 1 and not parts[-1].isdigit() and are_units(parts[-1:]) else ""
    return " ".join(parts), unit


def _column(column: Any, where: str, notes: list[str]) -> np.ndarray:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind):
        column, kind = column.cast(pa.timestamp("ns", kind.tz)).cast(pa.int64()), pa.int64()
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind):
        rows = [None if row is None else np.ravel(np.array(row, float)) for row in column.to_pylist()]
        width = max((len(row) for row in rows if row is not None), default=0) or 1
        if lacking := sum(row is None or len(row) != width for row in rows):
            notes.append(f"{where}: {lacking} rows with other than {width} values have no value")
        return np.array([row if row is not None and len(row) == width else np.full(width, np.nan) for row in rows])
    if pa.types.is_duration(kind):
        column, kind = column.cast(pa.int64()), pa.int64()
    # Texts that repeat are stored once each; their column has a type of its own.
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = kind.value_type
    if pa.types.is_decimal(kind):
        column, kind = column.cast(pa.float64()), pa.float64()
    if pa.types.is_integer(kind) and kind.bit_width == 64 and not column.null_count:
        values = column.to_numpy()
        # Integers beyond 2^53, as Unix nanoseconds, would be rounded as float64.
        return values if len(values) and np.abs(values).max() > 2**53 else values.astype(float)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
    return np.array([None if value is None else str(value) for value in column.to_pylist()], dtype=object)
