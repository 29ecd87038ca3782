"""Parquet and Feather tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tacdata.importing.formats.source_format import SourceFormat, SourceTable


class Parquet(SourceFormat):
    """Columns of an Arrow table; a list column becomes a table of its own."""

    endings = (".parquet", ".feather")

    def read(self, path: Path, options: dict[str, Any]) -> SourceTable:
        """Read all columns; nulls become NaN. See the base."""
        from pyarrow import feather, parquet

        table = feather.read_table(path) if path.suffix == ".feather" else parquet.read_table(path)
        columns = {str(name): _column(table.column(k)) for k, name in enumerate(table.column_names)}
        units = {
            field.name: field.metadata[b"unit"].decode()
            for field in table.schema
            if field.metadata and b"unit" in field.metadata
        }
        return SourceTable(path, columns, units)


def _column(column: Any) -> np.ndarray:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind):
        return np.asarray(column.cast(pa.timestamp("ns", kind.tz)).cast(pa.int64()).to_numpy())
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind):
        rows = column.to_pylist()
        width = max((len(row) for row in rows if row), default=1)
        return np.array(
            [row if row is not None and len(row) == width else [np.nan] * width for row in rows], dtype=float
        )
    if pa.types.is_integer(kind) and not column.null_count and kind.bit_width == 64:
        values = column.to_numpy()
        return values if len(values) and np.abs(values).max() > 2**53 else values.astype(float)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
    return np.array([None if value is None else str(value) for value in column.to_pylist()], dtype=object)
