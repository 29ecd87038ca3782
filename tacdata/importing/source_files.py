"""Finds the files of each trial: paths with {parts} that differ from trial to trial."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.documents import composed
from tacdata.errors import FormatError, UsageError
from tacdata.importing.expression import with_derived
from tacdata.importing.formats.source_format import read_table, tables_in
from tacdata.importing.mapping import FileEntry, Selector
from tacdata.importing.plausibility.copies import without_copies
from tacdata.importing.source_table import SourceTable, single


@dataclass(frozen=True)
class SourceFile:
    """One kind of file in a set: a file, or several that are joined."""

    entry: FileEntry
    paths: tuple[Path, ...]

    def read(self, where: str) -> SourceTable:
        """Return its rows, with those of further files and sheets joined, and the derived columns.

        Args:
            where: Names the file in errors of derived columns.

        Raises:
            FormatError: If a file cannot be read, or parts have no column in common.
        """
        entry = self.entry
        sheets = entry.table if isinstance(entry.table, list) else [entry.table]
        parts = [read_table(path, replace(entry.options, table=sheet)) for path in self.paths for sheet in sheets]
        clock = entry.clock.column if entry.clock else None
        if len(parts) == 1:
            (table,) = parts
        elif entry.join == "columns":
            names = titles_of(entry.paths) if len(entry.paths) == len(self.paths) else [p.stem for p in self.paths]
            titles = names if len(self.paths) > 1 else ("",)
            labels = [" ".join(filter(None, (title, sheet))) for title in titles for sheet in sheets]
            table = side_by_side(parts, labels, clock)
        else:
            table = joined(parts, clock if entry.join == "continued" else None)
        if clock is not None and not isinstance(clock, list) and entry.clock and entry.clock.rate is None:
            with suppress(FormatError):  # a clock that is not there is named where times are read
                table = without_copies(table, single(table, clock, where))
        return with_derived(table, entry.derived, where)


@dataclass(frozen=True)
class FileSet:
    """The files of one trial, or of several trials that share files."""

    parts: dict[str, str]
    """Value of each {part} of the paths."""
    files: dict[str, SourceFile]
    """Name in the mapping -> its file."""
    fault: FormatError | None = None
    """Why the files are not complete."""

    def tables(self) -> dict[str, SourceTable]:
        """Return the rows of every file; raises FormatError if one cannot be read."""
        return {name: file.read(f"files: {name}: derived") for name, file in self.files.items()}

    @property
    def label(self) -> str:
        """The values of the parts, as text."""
        return " ".join(self.parts.values())


FOLDERS = (".zarr",)
"""Endings of folders that count as one file."""


def is_one(path: Path) -> bool:
    """Return whether a path is a file, or a folder that counts as one."""
    return path.is_file() or (path.is_dir() and path.suffix in FOLDERS)


def check_source(source: Path) -> None:
    """Refuse a source that is neither a file nor a folder.

    Raises:
        UsageError: If it does not exist, or is a pipe, a socket or a device.
    """
    if not source.exists():
        raise UsageError(f"no file or folder {source}", "measured data", "check the path")
    if not source.is_file() and not source.is_dir():
        raise UsageError(
            f"{source} is a pipe or a device, which cannot be read twice",
            "a file or a folder",
            "save it as a file first",
        )


def files_below(folder: Path) -> list[Path]:
    """Return the files below a folder, sorted; a folder that counts as one file replaces its contents."""
    files = []
    for path in sorted(folder.iterdir()):
        # A link to a folder above would be walked without an end.
        circle = path.is_symlink() and path.is_dir() and folder.resolve().is_relative_to(path.resolve())
        files += [path] if is_one(path) else files_below(path) if path.is_dir() and not circle else []
    return sorted(files)


def source_hash(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of the files of a folder (hex)."""
    if path.is_file():
        return provenance.file_hash(path)
    # Paths are relative to the folder: a copy elsewhere has the same hash.
    inside = sorted(p for p in path.rglob("*") if p.is_file())
    return provenance.content_hash({p.relative_to(path).as_posix(): provenance.file_hash(p) for p in inside})


def file_sets(source: Path, files: dict[str, FileEntry]) -> list[FileSet]:
    """Return every set of files below a folder, or the one file that was given.

    Args:
        source: A folder, or a file if the mapping names one kind of file only, however many tables in it.
        files: Name -> kind of file.

    Raises:
        UsageError: If the source does not exist or no file fits.
    """
    check_source(source)
    if is_one(source) and len({path for entry in files.values() for path in entry.paths}) != 1:
        raise UsageError(
            f"{source} is one file, the mapping names {len(files)} ({', '.join(files)})",
            "the folder that holds them",
            "give the folder",
        )
    matches = {name: _hits(source, name, entry) for name, entry in files.items()}
    keys = {name: tuple(hits[0][0]) for name, hits in matches.items()}
    # The kind of file with the most parts defines the trials; others are shared by those whose parts agree.
    leading = max(keys, key=lambda name: len(keys[name]))
    led = [parts for parts, _ in matches[leading]]
    if files[leading].join:
        # Files that are joined repeat the parts of their trial, with a number more or without: each trial counts once.
        led = [parts for k, parts in enumerate(led) if not any(other.items() <= parts.items() for other in led[:k])]
    return [_set(parts, files, matches) for parts in led]


Hit = tuple[dict[str, str], Path]
"""A file, with the value of each {part} of its path."""


def _hits(source: Path, name: str, entry: FileEntry) -> list[Hit]:
    """Return the files of one kind; raises UsageError if there is none."""
    hits: list[Hit] = [({}, source)] if is_one(source) else []
    for path in entry.paths if not hits else ():
        fitting = _matches(source, path)
        if not fitting:
            names = [p.relative_to(source).as_posix() for p in files_below(source)]
            there = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "") or "nothing"
            remedy = f"correct files/{name}/path in the mapping; there is {there}"
            raise UsageError(f"no file fits {path} below {source}", "one or more", remedy)
        hits += fitting
    return _in_tables(hits, entry.table) if isinstance(entry.table, str) and "{" in entry.table else hits


def _set(parts: dict[str, str], files: dict[str, FileEntry], matches: dict[str, list[Hit]]) -> FileSet:
    """Return the files whose parts agree with those of a trial, or why they are not complete."""
    chosen: dict[str, SourceFile] = {}
    for name, entry in files.items():
        agreeing = (path for values, path in matches[name] if all(parts.get(k, v) == v for k, v in values.items()))
        fitting, required = tuple(agreeing), len(entry.paths)
        incomplete = len(fitting) < required if entry.join else len(fitting) != 1 or required > 1
        if incomplete:
            fault = FormatError(
                f"{len(fitting)} files {' and '.join(entry.paths)} for {parts or 'the source'}",
                "exactly one" if required == 1 else "one of each, and join: rows, continued or columns",
                "complete the source, or narrow the path with a {part} in the mapping",
            )
            return FileSet(parts, chosen, fault)
        if isinstance(entry.table, str):
            entry = replace(entry, table=entry.table.format(**parts) if "{" in entry.table else entry.table)
        chosen[name] = SourceFile(entry, fitting)
    return FileSet(parts, chosen)


def titles_of(patterns: Sequence[str]) -> tuple[str, ...]:
    """Return the names in paths without their folders, endings, {parts} and #."""
    names = [Path(pattern).stem for pattern in patterns]
    return tuple(re.sub(r"\{\w+\}|#", "", name).strip("_- ") or name for name in names)


def side_by_side(parts: list[SourceTable], titles: Sequence[str], clock: Selector | None) -> SourceTable:
    """Return tables next to each other, as of two boards with one clock. Names that repeat get a title in front.

    Raises:
        FormatError: If their clocks differ, or they have no column of times.
    """
    first, time = parts[0].path.name, None
    if clock is not None:
        time = single(parts[0], clock, "files: time: column")
        _check_clocks(parts, time)
    elif len({part.rows for part in parts}) > 1:
        rows = ", ".join(f"{part.path.name} {part.rows}" for part in parts)
        raise FormatError(f"parts of different rows ({rows})", "a row of each at each time", "give a time column")
    names = [name for part in parts for name in part.columns]
    columns, units, typed = dict[str, np.ndarray](), dict[str, str](), set[str]()
    for number, (part, title) in enumerate(zip(parts, titles, strict=True)):
        for name, values in part.columns.items():
            if name == time and number:
                continue
            new = f"{title} {name}" if names.count(name) > 1 and name != time else name
            columns[new] = values
            units |= {new: part.units[name]} if name in part.units else {}
            typed |= {new} if name in part.typed else set()
    notes = [f"{first}: the columns of {len(parts)} parts are side by side"]
    notes += [note for part in parts for note in part.notes]
    doubts = tuple(doubt for part in parts for doubt in part.doubts)
    return replace(parts[0], columns=columns, units=units, typed=frozenset(typed), notes=tuple(notes), doubts=doubts)


def _check_clocks(parts: list[SourceTable], time: str) -> None:
    """Refuse parts whose rows are of different times.

    Raises:
        FormatError: With the files and the largest difference.
    """
    first = parts[0].column(time)
    for part in parts[1:]:
        times = part.column(time) if time in part.columns else np.empty(0)
        if len(first) == len(times):
            if first.dtype == object or times.dtype == object:
                equal = bool((first == times).all())
            else:
                usual = float(np.median(np.abs(np.diff(first.astype(float))))) if len(first) > 1 else 0.0
                # Two loggers round one clock differently. Half an interval apart, the rows still belong together.
                equal = bool(np.nanmax(np.abs(first.astype(float) - times.astype(float)), initial=0.0) <= 0.5 * usual)
            if equal:
                continue
        raise FormatError(
            f"{parts[0].path.name} has {len(first)} rows by {time}, {part.path.name} {len(times)} of other times",
            "one clock for tables that are side by side",
            "give the second one a file of its own and bring its columns in under measured, with their own times",
        )


def joined(parts: list[SourceTable], continued: Selector | None = None) -> SourceTable:
    """Return tables below each other, with their common columns; the clock ``continued`` goes on from part to part.

    Raises:
        FormatError: If they have none in common, or the clock of a part is no number where it is to be continued.
    """
    shared = [name for name in parts[0].columns if all(name in part.columns for part in parts)]
    shared = [name for name in shared if len({part.column(name).shape[1:] for part in parts}) == 1]
    if not shared:
        listed = "; ".join(f"{part.path.name}: {', '.join(list(part.columns)[:8])}" for part in parts)
        raise FormatError(f"parts without a column in common ({listed})", "the same columns", "leave join out")
    columns = {name: [part.column(name) for part in parts] for name in shared}
    notes = [f"{parts[0].path.name}: the rows of {len(parts)} parts are below each other"]
    if isinstance(continued, str):
        name = single(parts[0], continued, "files: time: column")
        if any(values.dtype == object for values in columns.get(name, [np.empty(0, object)])):
            raise FormatError(f"{name} is no number in all parts", "a clock of numbers", "write join: rows")
        pieces = [np.asarray(columns[name][0], float)]
        for values in columns[name][1:]:
            # The pause between parts is unknown: the clock goes on by one usual interval.
            step = float(np.nanmedian(np.diff(pieces[-1])))
            pieces.append(np.asarray(values, float) + pieces[-1][-1] + step - float(values[0]))
        columns[name] = pieces
        notes.append(f"{parts[0].path.name}: {name} is continued from part to part")
    result = {
        name: np.concatenate([v.astype(object) for v in values] if any(v.dtype == object for v in values) else values)
        for name, values in columns.items()
    }
    lost = sorted({name for part in parts for name in part.columns} - set(shared))
    notes += [f"{parts[0].path.name}: not in all parts, left out: {', '.join(lost[:8])}"] * bool(lost)
    notes += [note for part in parts for note in part.notes]
    doubts = tuple(doubt for part in parts for doubt in part.doubts)
    return replace(parts[0], columns=result, notes=tuple(notes), doubts=doubts)


def _in_tables(files: list[Hit], pattern: str) -> list[Hit]:
    """Return each table of the files that fits a pattern, as "Run {n}" does, with its parts added to the path's."""
    fitting = [
        ({**parts, **match.groupdict()}, path)
        for parts, path in files
        for table in tables_in(path)
        if (match := re.fullmatch(_regex(pattern), composed(table)))
    ]
    if not fitting:
        tables = ", ".join(filter(None, tables_in(files[0][1]))) or "no table of its own: leave table out"
        raise UsageError(f"{files[0][1]}: no table fits {pattern}", tables, "correct table in the mapping")
    return fitting


def _matches(source: Path, pattern: str) -> list[Hit]:
    # Names are compared in composed form: macOS stores an accent as a character of its own.
    regex, hits = _regex(pattern), []
    for path in files_below(source):
        if match := re.fullmatch(regex, composed(path.relative_to(source).as_posix())):
            hits.append((match.groupdict(), path))
    return sorted(hits, key=lambda item: [natural(value) for value in (*item[0].values(), item[1].as_posix())])


def _regex(pattern: str) -> str:
    """Return a pattern of a path or a table as a regular expression with a group for each {part}."""
    names: set[str] = set()

    def part(match: re.Match[str]) -> str:
        text = match[0]
        if text == "**/":
            return "(?:.*/)?"
        if text == "*":
            return "[^/]*"
        name = text[1:-1]
        if name in names:
            return f"(?P={name})"
        names.add(name)
        return f"(?P<{name}>[^/]+?)"

    tokens = re.split(r"(\*\*/|\*|\{\w+\})", composed(pattern))
    return "".join(re.sub(r"^(\*\*/|\*|\{\w+\})$", part, t) if k % 2 else re.escape(t) for k, t in enumerate(tokens))


def natural(text: str) -> list[tuple[int, int, str]]:
    """Return the key by which names are sorted with their numbers by size."""
    return [(1, int(t), "") if t.isdigit() else (0, 0, t) for t in re.split(r"(\d+)", text) if t]
