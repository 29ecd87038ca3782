"""Finds the files of each trial: paths with {parts} that differ from trial to trial."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tacdata import provenance
from tacdata.documents import composed
from tacdata.errors import FormatError, UsageError
from tacdata.importing.formats.source_format import tables_in


@dataclass(frozen=True)
class FileSet:
    """The files of one trial, or of several trials that share files."""

    parts: dict[str, str]
    """Value of each {part} of the paths."""
    paths: dict[str, Path] = field(default_factory=dict)
    """Name under ``files`` -> path."""
    fault: FormatError | None = None
    """Why the files are not complete."""

    def options(self, name: str, mapping: dict[str, Any]) -> dict[str, Any]:
        """Return how a mapping has a file read, with the {parts} of its table filled in."""
        entry: dict[str, Any] = mapping["files"][name]
        return {**entry, "table": entry["table"].format(**self.parts)} if "{" in entry.get("table", "") else entry

    @property
    def label(self) -> str:
        """The values of the parts, as text."""
        return " ".join(self.parts.values())


FOLDERS = (".zarr",)
"""Endings of folders that count as one file."""


def is_one(path: Path) -> bool:
    """Return whether a path is a file, or a folder that counts as one."""
    return path.is_file() or (path.is_dir() and path.suffix in FOLDERS)


def files_below(folder: Path) -> list[Path]:
    """Return the files below a folder, sorted; a folder that counts as one stands for all that is in it."""
    found = []
    for path in sorted(folder.iterdir()):
        found += [path] if is_one(path) else files_below(path) if path.is_dir() else []
    return sorted(found)


def source_hash(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of the files of a folder (hex)."""
    if path.is_file():
        return provenance.file_hash(path)
    inside = sorted(p for p in path.rglob("*") if p.is_file())
    return provenance.content_hash({p.relative_to(path).as_posix(): provenance.file_hash(p) for p in inside})


def file_sets(source: Path, files: dict[str, dict[str, Any]]) -> list[FileSet]:
    """Return every set of files below a folder, or the one file that was given.

    Args:
        source: A folder, or a file if the mapping names one kind of file only, however many tables in it.
        files: ``files`` of the mapping.

    Raises:
        UsageError: If the source does not exist or no file fits.
    """
    if not source.exists():
        raise UsageError(f"no file or folder {source}", "measured data", "check the path")
    if is_one(source):
        if len({entry["path"] for entry in files.values()}) != 1:
            raise UsageError(
                f"{source} is one file, the mapping names {len(files)} ({', '.join(files)})",
                "the folder that holds them",
                "give the folder",
            )
        matches: dict[str, list[tuple[dict[str, str], Path]]] = {name: [({}, source)] for name in files}
    else:
        matches = {name: _matches(source, entry["path"]) for name, entry in files.items()}
    for name, found in matches.items():
        if not found:
            raise UsageError(
                f"no file fits {files[name]['path']} below {source}",
                "one or more",
                f"correct files/{name}/path in the mapping; there is {_listing(source)}",
            )
        if "{" in files[name].get("table", ""):
            matches[name] = _in_tables(found, files[name])
    keys = {name: tuple(found[0][0]) for name, found in matches.items()}
    # The kind of file with the most parts defines the trials; others are shared by those whose parts agree.
    leading = max(keys, key=lambda name: len(keys[name]))
    sets = []
    for parts, _ in matches[leading]:
        paths, fault = {}, None
        for name in files:
            fitting = [
                p for own, p in matches[name] if all(parts.get(key, value) == value for key, value in own.items())
            ]
            if len(fitting) != 1:
                fault = FormatError(
                    f"{len(fitting)} files {files[name]['path']} for {parts or 'the source'}",
                    "exactly one",
                    "complete the source, or narrow the path with a {part} in the mapping",
                )
                break
            paths[name] = fitting[0]
        sets.append(FileSet(parts, paths, fault))
    return sets


def _in_tables(found: list[tuple[dict[str, str], Path]], entry: dict[str, Any]) -> list[tuple[dict[str, str], Path]]:
    """Return each table of the files that fits the entry's, as "Run {n}" does, with its parts beside the path's."""
    fitting = [
        ({**parts, **match.groupdict()}, path)
        for parts, path in found
        for table in tables_in(path)
        if (match := re.fullmatch(_regex(entry["table"]), composed(table)))
    ]
    if not fitting:
        tables = ", ".join(tables_in(found[0][1]))
        raise UsageError(f"{found[0][1]}: no table fits {entry['table']}", tables, "correct table in the mapping")
    return fitting


def _matches(source: Path, pattern: str) -> list[tuple[dict[str, str], Path]]:
    regex, found = _regex(pattern), []
    for path in files_below(source):
        if match := re.fullmatch(regex, composed(path.relative_to(source).as_posix())):
            found.append((match.groupdict(), path))
    return sorted(found, key=lambda item: [_natural(value) for value in item[0].values()])


def _regex(pattern: str) -> str:
    """Return a pattern of a path or a table as a regular expression with a group for each {part}."""
    seen: set[str] = set()

    def part(match: re.Match[str]) -> str:
        text = match[0]
        if text == "**/":
            return "(?:.*/)?"
        if text == "*":
            return "[^/]*"
        name = text[1:-1]
        if name in seen:
            return f"(?P={name})"
        seen.add(name)
        return f"(?P<{name}>[^/]+?)"

    tokens = re.split(r"(\*\*/|\*|\{\w+\})", composed(pattern))
    return "".join(re.sub(r"^(\*\*/|\*|\{\w+\})$", part, t) if k % 2 else re.escape(t) for k, t in enumerate(tokens))


def _natural(text: str) -> list[tuple[int, int, str]]:
    return [(1, int(t), "") if t.isdigit() else (0, 0, t) for t in re.split(r"(\d+)", text) if t]


def _listing(source: Path) -> str:
    names = [p.relative_to(source).as_posix() for p in files_below(source)]
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "") or "nothing"
