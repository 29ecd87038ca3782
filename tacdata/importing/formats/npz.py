"""NumPy archives: .npz (one column or table an array) and .npy (one table)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tacdata.importing.formats.source_format import SourceFormat, SourceTable


class Npz(SourceFormat):
    """Arrays by name; those with another number of rows than most are left out and named."""

    endings = (".npz", ".npy")

    def read(self, path: Path, options: dict[str, Any]) -> SourceTable:
        """Read the arrays; nothing pickled is ever loaded. See the base."""
        # numpy leaves a damaged archive open that it opened itself.
        with path.open("rb") as stream:
            loaded = np.load(stream, allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return rows_of(path, {"array": loaded})
            return rows_of(path, {name: loaded[name] for name in loaded.files})


def rows_of(path: Path, arrays: dict[str, np.ndarray]) -> SourceTable:
    """Return the arrays that share one number of rows as a table: structured ones by field, others whole."""
    flat: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        if array.dtype.names:
            flat |= {field: array[field] for field in array.dtype.names}
        else:
            flat[name] = array
    columns = {name: _column(array) for name, array in flat.items() if array.size > 1}
    if not columns:
        return SourceTable(path, {})
    lengths = [len(values) for values in columns.values()]
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length))
    kept = {name: values for name, values in columns.items() if len(values) == rows}
    dropped = [f"{name} ({len(values)} rows)" for name, values in columns.items() if name not in kept]
    note = (f"{path.name}: not of {rows} rows, left out: {', '.join(dropped)}",) if dropped else ()
    return SourceTable(path, kept, notes=note)


def _column(array: np.ndarray) -> np.ndarray:
    values = np.squeeze(array)
    if values.ndim > 2:
        values = values.reshape(len(values), -1)
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]").astype(np.int64)
    if values.dtype.kind in "bui" and values.dtype.itemsize < 8:
        return values.astype(float)
    if values.dtype.kind in "iu":
        return values.astype(np.int64) if np.abs(values).max() > 2**53 else values.astype(float)
    return values.astype(float) if values.dtype.kind == "f" else values.astype(str).astype(object)
