"""Contents of foreign files: one table of each kind, and a listing for a person."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.importing.formats.csv import UnknownWord
from tacdata.importing.formats.source_format import is_known, read_table, tables_in
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.proposing.file_kinds import INSIDE, kinds_of, merged, numberless
from tacdata.importing.proposing.roles import is_whole, roles_of
from tacdata.importing.proposing.trial_parts import MOST, PartsInOrder, is_split_log, parts_in_order
from tacdata.importing.source_files import check_source, files_below, is_one, joined, natural, side_by_side, titles_of
from tacdata.importing.source_table import SourceTable

SHOWN = 30
"""Columns that are listed per file."""
SENTINELS = (-1, 0, -999, -9999, 9999, 65535)
"""Numbers that loggers write for no value."""


@dataclass(frozen=True)
class FoundKind:
    """Files, or tables in files, that hold the same columns."""

    table: SourceTable
    """The first one's."""
    path: str = ""
    """Of the first one, below the source."""
    count: int = 1
    options: ReadOptions = field(default_factory=ReadOptions)
    """Options by which it is read so."""
    words: dict[int, list[str]] = field(default_factory=dict)
    """Number of a # of the kind -> the words in its place."""
    parts: tuple[str, ...] = ()
    """Kinds that are parts of one trial, in their order."""
    join: str = ""
    """How the parts are joined, as in a mapping."""


def described(source: Path) -> tuple[dict[str, FoundKind], str]:
    """Return one table of each kind of file in a source, and a description of them.

    Raises:
        UsageError: If nothing there can be read.
    """
    check_source(source)
    try:
        return _described(source, "")
    except TacdataError as error:
        try:  # a machine's program gives its texts an ending of its own; among other data such files are notes
            return _described(source, "csv")
        except TacdataError:
            raise error from None


def _described(source: Path, form: str) -> tuple[dict[str, FoundKind], str]:
    """Return the tables and their description; with a format, those of files whose ending is not known."""
    paths = [source] if is_one(source) else files_below(source)
    paths = [path for path in paths if not form or not is_known(path)]
    kinds: dict[str, FoundKind] = {}
    refused, remedies = [], dict[str, None]()
    below = [path.relative_to(source) if path != source else Path(path.name) for path in paths]
    for path, name_below, kind in zip(paths, (p.as_posix() for p in below), kinds_of(list(below)), strict=True):
        members = [key for key in kinds if key.partition(INSIDE)[0] == kind]
        kinds |= {key: replace(kinds[key], count=kinds[key].count + 1) for key in members}
        if members or kind in refused:
            continue
        try:
            for name in tables_in(path) if not form else ("",):
                key = f"{kind}{INSIDE}{numberless(name)}" if name else kind
                if key in kinds:
                    kinds[key] = replace(kinds[key], count=kinds[key].count + 1)
                    continue
                table, options = _read(path, ReadOptions(table=name or None, format=form))
                kinds[key] = FoundKind(table, name_below, 1, options)
        except ModuleNotFoundError:
            raise
        except Exception as error:  # a README among the data is no error
            if is_one(source) and isinstance(error, TacdataError):
                raise
            words = error.given if isinstance(error, TacdataError) else f"{kind}: {type(error).__name__}"
            remedies |= {error.remedy: None} if isinstance(error, TacdataError) else {}
            refused.append(words.removeprefix(f"{source}/"))
    if not kinds:
        raise UsageError(
            f"no file in {source} can be read as columns ({', '.join(refused) or 'it is empty'})",
            "CSV, Excel, JSON, NPZ, Parquet, MATLAB, HDF5 or TDMS files, or bags of ROS 2",
            next(iter(remedies)) if len(remedies) == 1 else "check the path, or convert the files",
        )
    kinds = _of_same_columns(_split_logs(source, kinds, paths))
    lines = []
    for key, entry in kinds.items():
        kind, _, inside = key.partition(INSIDE)
        files = f"{entry.count} {'table' if inside and '#' in inside else 'file'}{'s' * (entry.count > 1)}"
        lines.append(f"{kind} ({files}){f', {inside}' if inside else ''}: {entry.table.rows} rows")
        lines += _columns(entry.table)
        lines += [f"    {note}" for note in entry.table.notes]
    lines += [f"not read: {text}" for text in refused]
    return kinds, "\n".join(lines)


def _read(path: Path, options: ReadOptions) -> tuple[SourceTable, ReadOptions]:
    """Return a file's table and the options that read it: with trials along the axis that loses fewest arrays."""
    try:
        table = read_table(path, options)
    except UnknownWord as error:
        if not error.word or any(map(str.isdigit, error.word)):
            raise
        return _read(path, replace(options, missing=(*options.missing, error.word)))
    best, best_options = len(_lost(table)), options
    for axis in (2, 0, 1) if path.suffix in (".mat", ".npz") and best else ():
        try:
            tried = read_table(path, replace(options, trial_axis=axis))
        except FormatError:
            break
        if len(_lost(tried)) < best:
            table, best, best_options = tried, len(_lost(tried)), replace(options, trial_axis=axis)
    if not best and any("trial_axis" in note for note in table.notes):
        for axis in (2, 1, 0):
            tried = read_table(path, replace(options, trial_axis=axis))
            if _one_clock(tried):
                return tried, replace(options, trial_axis=axis)
    return table, best_options


def _one_clock(table: SourceTable) -> bool:
    """Return whether the first column of the trials of an array is the same in each and rises, as a clock does."""
    name, trial = next(iter(table.columns)), table.columns.get("trial")
    if trial is None or not table.inner(name):
        return False
    clock = table.column(f"{name}[0]")
    first, second = (clock[trial == number] for number in (0, 1))
    return len(first) > 2 and np.array_equal(first, second) and bool((np.diff(first) > 0).all())


def _lost(table: SourceTable) -> list[str]:
    """Return the arrays that were left out because they have other rows."""
    return [name for note in table.notes if "left out" in note for name in note.split("left out: ")[-1].split(", ")]


def _of_same_columns(kinds: dict[str, FoundKind]) -> dict[str, FoundKind]:
    """Put kinds together that are whole trials of the same columns: their paths differ by words."""
    alike: dict[Any, list[str]] = {}
    kinds = _boards_together(kinds)
    for key, entry in kinds.items():
        identity = key if entry.join or not is_whole(roles_of(entry.table)) else ""
        depth = key.partition(INSIDE)[0].count("/")
        alike.setdefault((identity, depth, INSIDE in key, tuple(entry.table.columns)), []).append(key)
    result = {}
    for keys in alike.values():
        if len(keys) > 1 and (order := parts_in_order({key: kinds[key].table for key in keys})):
            result[order.keys[0]] = _joined_kind(order, kinds)
            continue
        pattern = merged(keys) if len(keys) > 1 else None
        if pattern is None:
            result |= {key: kinds[key] for key in keys}
            continue
        first = kinds[keys[0]]
        result[pattern] = replace(first, count=sum(kinds[key].count for key in keys), words=_words(keys, pattern))
    return result


def _split_logs(source: Path, kinds: dict[str, FoundKind], paths: list[Path]) -> dict[str, FoundKind]:
    """Put the files of a log that goes on from file to file together, by those of the first folder."""
    result = {}
    for key, entry in kinds.items():
        head, _, tail = key.rpartition("#")
        first = source / entry.path
        siblings = [path for path in paths if path.parent == first.parent and path.suffix == first.suffix]
        siblings = [path for path in siblings if numberless(path.stem) == numberless(first.stem)][:MOST]
        if entry.count < 2 or INSIDE in key or not head or "/" in tail or len(siblings) < 2:
            result[key] = entry
            continue
        try:
            tables = [read_table(path, entry.options) for path in sorted(siblings, key=lambda path: natural(path.name))]
        except TacdataError:  # named where it is imported
            result[key] = entry
            continue
        if not is_split_log(tables):
            result[key] = entry
            continue
        pattern = f"{head}*{tail}"
        result[pattern] = replace(entry, table=joined(tables), parts=(pattern,), join="rows")
    return result


def _boards_together(kinds: dict[str, FoundKind]) -> dict[str, FoundKind]:
    """Put kinds together that hold the same channels at the same times, next to a kind with the position."""
    roles = {key: roles_of(entry.table) for key, entry in kinds.items()}
    if not any({"depth", "z"} & set(each) for each in roles.values()):
        return kinds
    boards: dict[Any, list[str]] = {}
    for key, each in roles.items():
        if each["channels"] and each.get("time") and not {"depth", "z"} & set(each):
            clock = kinds[key].table.column(each["time"][0])
            boards.setdefault((tuple(kinds[key].table.columns), len(clock), kinds[key].count), []).append(key)
    for keys in boards.values():
        clocks = [kinds[key].table.column(roles[key]["time"][0]) for key in keys]
        if len(keys) < 2 or any(clock.dtype == object or not np.allclose(clock, clocks[0]) for clock in clocks):
            continue
        kinds = {key: entry for key, entry in kinds.items() if key not in keys[1:]} | {
            keys[0]: _joined_kind(PartsInOrder(tuple(keys), "columns"), kinds)
        }
    return kinds


def _joined_kind(order: PartsInOrder, kinds: dict[str, FoundKind]) -> FoundKind:
    """Return the kind of a trial whose parts are in several files or sheets."""
    tables = [kinds[key].table for key in order.keys]
    time = (roles_of(tables[0]).get("time") or [None])[0]
    if order.join == "columns":
        outer, sheets = zip(*(key.partition(INSIDE)[::2] for key in order.keys), strict=True)
        titles = titles_of(outer) if len(set(outer)) > 1 else [""] * len(outer)
        labels = [" ".join(filter(None, pair)) for pair in zip(titles, sheets, strict=True)]
        table = side_by_side(tables, labels, time)
    else:
        table = joined(tables, time if order.join == "continued" else None)
    return replace(kinds[order.keys[0]], table=table, parts=order.keys, join=order.join)


def _words(keys: list[str], pattern: str) -> dict[int, list[str]]:
    """Return the names of each level of folders that were put together, by the number of its #."""
    words: dict[int, list[str]] = {}
    steps = pattern.partition(INSIDE)[0].split("/")
    for level, step in enumerate(steps[:-1]):
        names = list(dict.fromkeys(key.split("/")[level] for key in keys))
        if len(names) > 1 and step.count("#") == 1:
            words["/".join(steps[:level]).count("#")] = names
    return words


def _columns(table: SourceTable) -> list[str]:
    names = list(table.columns)
    if len(names) == 1 and 0 < table.inner(names[0]) <= SHOWN:
        # An array without names: a person recognizes its columns by their values.
        names = [f"{names[0]}[{k}]" for k in range(table.inner(names[0]))]
    lines = [_line(table, name) for name in names[:SHOWN]]
    return lines + ([f"    and {len(names) - SHOWN} more columns"] if len(names) > SHOWN else [])


def _line(table: SourceTable, name: str) -> str:
    values = table.column(name)
    unit = table.units.get(name, "")
    is_named = any(f"{opening}{unit}{closing}" in name for opening, closing in ("[]", "()", "{}"))
    unit = f" [{unit}]" if unit and not is_named else ""
    if values.dtype == object:
        texts = sorted({str(value) for value in values.tolist() if value is not None})
        return f"    {name}{unit}: text, {len(texts)} different, for example {', '.join(texts[:3])}"
    numbers = values.astype(float)
    missing = np.isnan(numbers).mean()
    shape = f" x {values.shape[1]}" if values.ndim > 1 else ""
    if missing == 1:
        return f"    {name}{unit}{shape}: no value"
    low, high = np.nanmin(numbers) + 0.0, np.nanmax(numbers) + 0.0  # no "-0"
    remark = f", {100 * missing:.0f} % missing" * bool(missing) + _sentinel(numbers)
    return f"    {name}{unit}{shape}: {low:.9g} to {high:.9g}{remark}"


def _sentinel(numbers: np.ndarray) -> str:
    """Return a remark on a number that may stand for no value: frequent, and far from all others.

    A stage at rest at 0 is none: it leaves 0 in small steps.
    """
    distinct, times = np.unique(numbers[np.isfinite(numbers)], return_counts=True)
    often = times.max() / numbers.size
    value = distinct[times.argmax()]
    remainder = distinct[distinct != value]
    if often <= 0.2 or len(distinct) <= 10 or value not in SENTINELS:
        return ""
    if np.abs(remainder - value).min() < 0.1 * np.ptp(remainder):
        return ""
    return f", {100 * often:.0f} % are {value:g}: missing?"
