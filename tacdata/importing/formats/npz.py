"""NumPy archives: .npz (one column or table an array) and .npy (one table)."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth, zipped_size
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

LONG = 10
"""A lone array whose second axis is longer by this factor than its first has time along it [1]."""
WHOLE = "array"
"""Name of a file's only array."""


class Npz(SourceFormat):
    """Arrays by name; those with another number of rows than most are left out and named."""

    endings = (".npz", ".npy")

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the arrays; nothing pickled is ever loaded. See the base."""
        refuse_growth(path, zipped_size(path))
        # numpy leaves a damaged archive open that it opened itself.
        with path.open("rb") as stream:
            try:
                loaded = np.load(stream, allow_pickle=False)
            except ValueError as error:
                if "Object arrays" not in str(error):
                    raise
                raise FormatError(
                    f"{path} holds objects of Python, as a dict or lists, and no array of numbers",
                    "arrays of numbers",
                    "in Python: d = np.load(name, allow_pickle=True).item(); np.savez(new_name, **d)",
                ) from None
            if isinstance(loaded, np.ndarray):
                return rows_of(path, {WHOLE: loaded}, options)
            return rows_of(path, {name: loaded[name] for name in loaded.files}, options)


def rows_of(path: Path, arrays: dict[str, np.ndarray], options: ReadOptions) -> SourceTable:
    """Return the arrays that share one number of rows as a table: structured ones by field, others whole.

    With ``trial_axis`` in the options, trials lie along that axis of arrays of three axes. They are put below each
    other, with a column ``trial`` that counts them from 0.

    Raises:
        FormatError: If no array has that axis.
    """
    arrays, remarks = _upright(path, arrays, options)
    if options.trial_axis is not None:
        arrays = _below_each_other(path, arrays, options.trial_axis)
    flat = _named(_flat(arrays))
    columns = {name: _column(array) for name, array in flat.items() if array.size > 1}
    if not columns:
        return SourceTable(path, {})
    lengths = [len(values) for values in columns.values()]
    # Most arrays of a recording have a value a row. Settings and labels are of other lengths.
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length))
    notes = [*remarks, *_shapes(path, arrays, options)]
    for name, values in columns.items():
        if len(values) != rows and values.ndim == 2 and values.shape[1] == rows:
            columns[name] = values.T
            notes.append(f"{path.name}: {name} holds {values.shape[0]} x {rows} values; time is its second axis")
    selection = {name: values for name, values in columns.items() if len(values) == rows}
    dropped = [f"{name} ({len(values)} rows)" for name, values in columns.items() if name not in selection]
    if dropped:
        notes.append(f"{path.name}: not of {rows} rows, left out: {', '.join(dropped)}")
    units = {name: "ns" for name, array in flat.items() if array.dtype.kind in "mM"}
    return SourceTable(path, selection, units, frozenset(units), tuple(notes))


def _named(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return arrays with the columns of a table by their names, if an array of as many different texts gives them."""
    texts = [np.squeeze(array).astype(str).tolist() for array in arrays.values() if array.dtype.kind in "SU"]
    named: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        width = array.shape[1] if array.ndim == 2 and array.dtype.kind in "biuf" else 0
        names = [each for each in texts if isinstance(each, list) and len(set(each)) == len(each) == width > 1]
        named |= dict(zip(names[0], array.T, strict=True)) if len(names) == 1 else {name: array}
    return named


def _upright(
    path: Path, arrays: dict[str, np.ndarray], options: ReadOptions
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return arrays with time as their first axis, by the mapping or the shape of a lone array; and a note."""
    if options.transpose is not None:
        return {name: array.T if options.transpose and array.ndim == 2 else array for name, array in arrays.items()}, []
    if lying := _lying(arrays):
        shapes = ", ".join(f"{name} {' x '.join(map(str, array.shape))}" for name, array in arrays.items())
        words = "the second axis is taken for time (transpose: false under the file takes the first)"
        return lying, [f"{path.name}: {shapes} values; {words}"]
    lone = next(iter(arrays.values())) if len(arrays) == 1 else None
    if lone is None or lone.ndim != 2 or lone.dtype.names or lone.shape[1] <= LONG * lone.shape[0]:
        return arrays, []
    if lone.shape[0] < 2:
        return arrays, []
    shape = " x ".join(map(str, lone.shape))
    words = "its second axis is taken for time (transpose: false under the file takes the first)"
    return dict.fromkeys(arrays, lone.T), [f"{path.name}: {shape} values; {words}"]


def _lying(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return arrays turned, if all of them lie: few rows of one great length; {} if they do not."""
    tables = {name: array for name, array in arrays.items() if array.ndim == 2 and min(array.shape) > 1}
    lengths = {array.shape[1] for array in tables.values()}
    if len(tables) < 2 or len(lengths) > 1 or any(len(a) * LONG > a.shape[1] or a.dtype.names for a in tables.values()):
        return {}
    return {name: array.T if name in tables else array for name, array in arrays.items()}


def _flat(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return plain arrays by name. Fields of structured ones lose their array's name unless another has the same."""
    fields = [(name, inner, array) for name, outer in arrays.items() for inner, array in _fields(outer)]
    count = Counter(inner or name for name, inner, _ in fields)
    return {
        (inner if count[inner] == 1 else f"{name}.{inner}") if inner else name: array for name, inner, array in fields
    }


def _fields(array: np.ndarray, inside: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield the fields of a structured array, a plain one under "", fields inside fields as ``outer.inner``."""
    if not array.dtype.names:
        yield inside, array
    for field in array.dtype.names or ():
        yield from _fields(array[field], f"{inside}.{field}" if inside else field)


def _shapes(path: Path, arrays: dict[str, np.ndarray], options: ReadOptions) -> list[str]:
    """Return the assumption about a file of one array: which of its axes is time."""
    array = np.squeeze(next(iter(arrays.values())))
    if len(arrays) > 1 or array.dtype.names or options.trial_axis is not None:
        return []
    shape = " x ".join(map(str, array.shape))
    if array.ndim > 2:
        return [f"{path.name}: {shape} values; its first axis is taken for time (trial_axis names the axis of trials)"]
    if array.ndim == 2 and array.shape[0] < array.shape[1]:
        words = "its first axis is taken for time; if it is the second, write transpose: true under the file"
        return [f"{path.name}: {shape} values; {words}"]
    return []


def _below_each_other(path: Path, arrays: dict[str, np.ndarray], axis: int) -> dict[str, np.ndarray]:
    """Return arrays with the trials of one axis as rows.

    Arrays of two axes hold one value a row and trial; those of one axis a value a row, or a value a trial.
    """
    blocks = {name: np.moveaxis(array, axis, 0) for name, array in arrays.items() if array.ndim == 3}
    if not blocks:
        shapes = ", ".join(f"{name} {'x'.join(map(str, array.shape))}" for name, array in arrays.items())
        raise FormatError(
            f"{path}: trial_axis {axis}, but no array has three axes ({shapes})",
            "an array with one axis for trials, one for rows and one for channels",
            "leave trial_axis out",
        )
    trials, rows = max(blocks.values(), key=np.size).shape[:2]
    trial_blocks = {name: block for name, block in blocks.items() if block.shape[:2] == (trials, rows)}
    result: dict[str, np.ndarray] = {name: block.reshape(trials * rows, -1) for name, block in trial_blocks.items()}
    for name, array in ((name, np.squeeze(array)) for name, array in arrays.items() if name not in trial_blocks):
        if array.shape == (trials, rows):
            result[name] = array.ravel()
        elif array.shape == (rows, trials):
            result[name] = array.T.ravel()
        elif array.shape == (rows,):
            result[name] = np.tile(array, trials)
        elif array.shape == (trials,):
            result[name] = np.repeat(array, rows)
        else:
            result[name] = array  # of another number of rows: left out and named with the others
    return {**result, "trial": np.repeat(np.arange(trials), rows)}


def _column(array: np.ndarray) -> np.ndarray:
    values = np.atleast_1d(np.squeeze(array))
    if values.ndim > 2:
        values = values.reshape(len(values), -1)
    if values.dtype.kind == "m":
        nanoseconds = values.astype("timedelta64[ns]").astype(np.int64)
        return np.where(np.isnat(values), np.nan, nanoseconds) if np.isnat(values).any() else nanoseconds
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]").astype(np.int64)
    if values.dtype.kind in "bui" and values.dtype.itemsize < 8:
        return values.astype(float)
    if values.dtype.kind in "iu":
        # Only integers beyond 2^53 stay so, as Unix nanoseconds: a float64 would round them.
        return values.astype(np.int64) if np.abs(values).max() > 2**53 else values.astype(float)
    return values.astype(float) if values.dtype.kind == "f" else values.astype(str).astype(object)


def stacked(name: str, tables: list[dict[str, np.ndarray]], lost: list[str]) -> dict[str, np.ndarray]:
    """Return tables of several trials below one another, with a column ``element`` that numbers them.

    Args:
        name: Put before the names of the columns; may be empty.
        tables: Columns of each trial; a single value holds for all of its rows.
        lost: Receives the names of columns that are left out, with the reason.
    """
    rows = [max((len(np.atleast_1d(a)) for a in table.values()), default=0) for table in tables]
    shared = [key for key in tables[0] if all(key in table for table in tables)]
    prefix = f"{name}." if name else ""
    lost += [
        f"{prefix}{key} (not in all {len(tables)} elements)"
        for key in dict.fromkeys(k for table in tables for k in table)
        if key not in shared
    ]
    columns = {}
    for key in shared:
        parts = []
        for table, count in zip(tables, rows, strict=True):
            part = np.squeeze(table[key])
            # A single value of an element (its speed, its label) holds for all of its rows.
            parts.append(np.repeat(part[None], count, axis=0) if part.ndim == 0 else part)
        if len({part.shape[1:] for part in parts}) == 1 and all(len(p) == n for p, n in zip(parts, rows, strict=True)):
            columns[prefix + key] = np.concatenate(parts)
        else:
            lost.append(f"{prefix}{key} (of other rows than its element)")
    return {**columns, f"{prefix}element": np.repeat(np.arange(len(tables)), rows)}
