"""HDF5 files, and MATLAB files of version 7.3, which are HDF5: groups of arrays of one length are tables."""

import math
import os
import posixpath
import re
import resource
import signal
import warnings
from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.npz import WHOLE, rows_of
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.formats.zarr import WIDEST, by_attributes
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

LONGEST, LONGEST_WAIT, RATE_OF_INDEX = 5, 120, 10_000_000
"""Time that the index of a small file may take, of the processor and by the clock [s]; of a large one [byte/s]."""
CLASS = "MATLAB_class"
"""Attribute of MATLAB's variables, whose axes are in reverse order."""
RATE = re.compile(r"((sampl\w*|scan|acquisition)[ _-]*)?(rate|freq(uency)?|fs)([ _-]*hz)?", re.IGNORECASE)
"""Name of an attribute that states a rate [Hz]."""
NUMBER = re.compile(r"\d+")
TRIAL = re.compile(r"trial|run|press|demo|episode|test|rep|cycle|exp|specimen|sample|touch|indent", re.IGNORECASE)
"""Names of groups that are trials, even where an array above them has their rows."""


class Hdf5(SourceFormat):
    """Datasets below one group with one number of rows, as columns by their path; of several such tables one is named.

    Attributes give units, scales and rates. Parts of a dataset that were never written have no value.
    """

    endings = (".h5", ".hdf5", ".hdf")

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the groups that are tables, if there are several; see the base."""
        with _opened(path) as file:
            tables = _tables(_datasets(file)[0])
        return tuple(tables) if len(tables) > 1 else ("",)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the group that ``table`` names, or the only one. See the base class."""
        arrays, units, rates = {}, {}, set()
        with _opened(path) as file:
            datasets, lost = _datasets(file)
            tables = _tables(datasets)
            name = chosen_table(path, list(tables), options)
            inside = {column: datasets[key] for key, column in columns_of(tables.get(name, ())).items()}
            if name in datasets and len(_shape(datasets[name])) > 1 and len(inside) == 1:  # a trial has no name
                inside = {WHOLE: datasets[name]}
            refuse_growth(path, float(sum(8 * math.prod(each.shape) for each in inside.values())))
            for column, dataset in inside.items():
                values, words = _values(dataset)
                values, unit = by_attributes(values, _attributes(dataset))
                lost += [f"{column} {words}"] if words else []
                items = datasets.get(f"{dataset.name[1:].removesuffix('_values')}_items")
                if items is not None and values.ndim == 2 and items.shape == values.shape[1:]:  # a block of pandas
                    arrays |= dict(zip(items.asstr()[:].tolist(), values.T, strict=True))
                    continue
                arrays[column] = values
                units |= {column: unit} if unit else {}
                rates |= {rate for above in (dataset, dataset.parent, file) for rate in _rates(above)}
        table = rows_of(path, arrays, options)
        notes = [f"{path.name}: without a value or left out: {', '.join(lost)}"] if lost else []
        rate = rates.pop() if len(rates) == 1 else 0.0
        return replace(table, units={**units, **table.units}, rate=rate, notes=(*notes, *table.notes))


def chosen_table(path: Path, tables: list[str], options: ReadOptions) -> str:
    """Return the name of the table that is to be read; "" if there is none.

    Raises:
        FormatError: If there are several and none is named, or none of that name.
    """
    if options.table in tables or (not options.table and len(tables) < 2):
        return options.table or "".join(tables)
    fault = f"no table {options.table}" if options.table else f"{len(tables)} tables, and none is named"
    raise FormatError(f"{path}: {fault}", ", ".join(tables) or "none", "name one by table in the mapping")


def tables_of(rows: Mapping[str, Hashable], whole: Collection[str] = ()) -> dict[str, list[str]]:
    """Return arrays by table, whose name is its group, or its first array where a group holds several tables.

    Arrays below one group with one number of rows are a table. Groups side by side have tables of their own where they
    are trials, or share names while no array above them has their rows.

    Args:
        rows: Path of each array -> its number of rows, or anything that the arrays of a table share.
        whole: Arrays of several columns: such of one name, but for a number, are tables of their own.
    """
    tables: dict[str, list[str]] = {}
    _add("", _loose("", rows, whole, tables), rows, whole, tables)
    return tables


def columns_of(names: Sequence[str]) -> dict[str, str]:
    """Return the column of each array of a table: its path below the group that holds all of them."""
    above = posixpath.commonpath([f"/{posixpath.dirname(name)}" for name in names]) if names else "/"
    return {name: f"/{name}".removeprefix(above).lstrip("/").replace("/", ".") for name in names}


def _loose(group: str, rows: Mapping[str, Hashable], whole: Collection[str], tables: dict[str, list[str]]) -> list[str]:
    """Return the arrays below a group that are in no table of a group inside it; add those tables."""
    begin, direct, inside = len(group), [], dict[str, dict[str, Hashable]]()
    for name, count in rows.items():
        head, slash, _ = name[begin:].partition("/")
        if slash:
            inside.setdefault(name[:begin] + head, {})[name] = count
        else:
            direct.append(name)
    shared = Counter(name[len(child) :] for child, names in inside.items() for name in names)
    above = {rows[name] for name in direct}
    for child, names in inside.items():
        own = _loose(f"{child}/", names, whole, tables)
        again = any(shared[name[len(child) :]] > 1 for name in names)
        if again and (TRIAL.search(child[begin:]) or not {rows[name] for name in own} <= above):
            _add(child, own, rows, whole, tables)
        else:
            direct += own
    return direct


def _add(
    group: str, names: list[str], rows: Mapping[str, Hashable], whole: Collection[str], tables: dict[str, list[str]]
) -> None:
    """Add the tables of a group: one for each number of rows, or for each array if all of them are trials."""
    if len(names) > 1 and set(names) <= set(whole) and len({NUMBER.sub("#", name) for name in names}) == 1:
        tables |= {name: [name] for name in names}
        return
    counts: dict[Hashable, list[str]] = {}
    for name in names:
        counts.setdefault(rows[name], []).append(name)
    # The most arrays bear the group's name, so that trials of which one holds a setting more are alike.
    main = max(counts.values(), key=len, default=[]) if group or len(counts) == 1 else []
    tables |= {group if members is main else members[0]: members for members in counts.values()}


def _opened(path: Path) -> Any:
    """Return an open file.

    Raises:
        FormatError: If the library goes round in circles in its index, or crashes there.
    """
    import h5py

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which the copy needs
        copy = os.fork()
    if not copy:
        # Here, and not in this process: a loop inside the library ends by no exception, and by no Ctrl-C.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(LONGEST_WAIT)
        seconds = LONGEST + path.stat().st_size // RATE_OF_INDEX
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        with suppress(BaseException), h5py.File(path, "r", locking="best-effort") as file:
            for dataset in _datasets(file)[0].values():
                _chunks(dataset)
        os._exit(0)
    if os.WIFSIGNALED(os.waitpid(copy, 0)[1]):
        raise FormatError(f"{path}: its index is damaged", "a whole file", "copy it again, or save its arrays again")
    return h5py.File(path, "r", locking="best-effort")


def _datasets(file: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the arrays of a file that may be columns by their path, and the remaining ones with the reason."""
    import h5py

    found: dict[str, Any] = {}
    lost: list[str] = []

    def look(name: str, entry: Any) -> None:
        if not isinstance(entry, h5py.Dataset) or name.startswith("#") or not entry.shape or entry.size < 2:
            return
        kind, text = entry.dtype, h5py.check_string_dtype(entry.dtype)
        if entry.is_virtual or entry.external:
            lost.append(f"{name} (its values lie in other files)")
        elif math.prod(entry.shape[1:]) > WIDEST and len(entry.shape) > 2:
            lost.append(f"{name} ({' x '.join(map(str, entry.shape[1:]))} values a row)")
        elif not (kind.names or text or kind.kind in "biuf") or _attributes(entry).get(CLASS) in ("char", "cell"):
            lost.append(f"{name} (neither numbers nor texts)")
        else:
            found[name] = entry

    file.visititems(look)
    return found, lost


def _tables(datasets: dict[str, Any]) -> dict[str, list[str]]:
    """Return the paths of datasets by table; tables of texts alone are none."""
    shapes = {name: [size for size in _shape(entry) if size > 1] for name, entry in datasets.items()}
    lone = {shape[0] for shape in shapes.values() if len(shape) == 1}
    # An array that lies has time along its second axis; `rows_of` turns it and says so.
    rows = {
        name: shape[1] if len(shape) == 2 and shape[0] not in lone and shape[1] in lone else shape[0]
        for name, shape in shapes.items()
    }
    tables = tables_of(rows, [name for name, shape in shapes.items() if len(shape) > 1 or datasets[name].dtype.names])
    return {table: names for table, names in tables.items() if any(datasets[n].dtype.kind in "biufV" for n in names)}


def _shape(dataset: Any) -> tuple[int, ...]:
    return dataset.shape[::-1] if CLASS in dataset.attrs else dataset.shape


def _values(dataset: Any) -> tuple[np.ndarray, str]:
    """Return a dataset's values with NaN for parts that were never written, and how many of its parts these are."""
    import h5py

    values, words = dataset.asstr(errors="replace")[:] if h5py.check_string_dtype(dataset.dtype) else dataset[:], ""
    parts = math.prod(-(-n // k) for n, k in zip(dataset.shape, dataset.chunks, strict=True)) if dataset.chunks else 1
    chunks = _chunks(dataset)
    written = len(chunks) if dataset.chunks else int(dataset.id.get_storage_size() > 0)
    if written < parts and values.dtype.kind in "biuf":
        stored = np.zeros(values.shape, bool)
        for start in chunks:
            stored[tuple(slice(a, a + size) for a, size in zip(start, dataset.chunks, strict=True))] = True
        values, words = np.where(stored, values, np.nan), f"({parts - written} of {parts} parts were never written)"
    return values.T if CLASS in dataset.attrs else values, words


def _chunks(dataset: Any) -> list[tuple[int, ...]]:
    """Return the first index of each part of a dataset that was written; [] where it has no parts."""
    count = dataset.id.get_num_chunks() if dataset.chunks else 0
    return [dataset.id.get_chunk_info(number).chunk_offset for number in range(count)]


def _attributes(entry: Any) -> dict[str, Any]:
    """Return the attributes of a dataset or group that are one number or one text."""
    attributes = {}
    for name in entry.attrs:
        value = entry.attrs[name] if entry.attrs.get_id(name).dtype.kind in "biufSO" else None
        value = value.item() if isinstance(value, np.ndarray | np.generic) and value.size == 1 else value
        if isinstance(value, str | bytes | int | float):
            key = name.lower() if name.lower() in ("unit", "units") else name
            attributes[key] = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return attributes


def _rates(entry: Any) -> list[float]:
    """Return the rates that attributes state [Hz]."""
    numbers = [(name, value) for name, value in _attributes(entry).items() if RATE.fullmatch(name)]
    return [float(value) for _, value in numbers if isinstance(value, int | float) and value > 0]
