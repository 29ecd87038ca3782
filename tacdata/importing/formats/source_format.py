"""Base class of a source format.

``tacdata/importing/formats/my_format.py`` defines one class derived from `SourceFormat`. It names its file endings and
reads a file into a `SourceTable`: named columns as they stand in the file, nothing converted or filled in.
"""

import gc
import traceback
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tacdata import registry
from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.importing.text.written_numbers import written_numbers

AUTOMATIC = ReadOptions()
"""Options of a file that is read as it is recognized."""
ROOM, BASE = "tacdata.importing.formats", "source_format"
LONGEST = 300
"""Letters of a library's words that an error repeats."""
LARGEST, DENSEST = 256 * 1024 * 1024, 100
"""Bytes that a file may become when it is read [byte], and how often its own size it may become beyond them [1]."""
OLD_OFFICE = b"\xd0\xcf\x11\xe0"
MAGIC = {
    b"\x1f\x8b": "gzip (.gz)",
    b"PK\x03\x04": "a zip archive (such as .zip, .npz or .xlsx)",
    b"PAR1": "Parquet",
    b"ARROW1": "Feather",
    b"\x89HDF": "HDF5",
    b"MATLAB 5.0": "a MATLAB file (.mat)",
    b"\x93NUMPY": "NumPy (.npy)",
    b"SQLite format 3": "SQLite (.db3)",
    b"\x89MCAP": "MCAP",
    b"\x89PNG": "a PNG image",
    b"\xff\xd8": "a JPEG image",
    b"%PDF": "PDF",
    OLD_OFFICE: "an old Office file (.xls)",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""First bytes of files and the kind of file that begins so."""

CONVERSIONS = {
    ".ods": "open it in LibreOffice and save it as .xlsx",
    **dict.fromkeys((".zip", ".7z", ".rar", ".tar", ".tgz", ".bz2", ".xz", ".zst"), "unpack it, and import the folder"),
    ".sqlite": "in Python: pandas.read_sql(...).to_parquet(new_name)",
    ".pkl": "in Python: pandas.read_pickle(name).to_parquet(new_name)",
}
"""Endings of files that are not read, and the way to a file that is."""


class SourceFormat(ABC):
    """Reads files of one kind."""

    endings: ClassVar[tuple[str, ...]]
    """File name endings, lower case, with the dot."""

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the tables in a file, of which ``table`` in the options chooses one; ("",) if the file is a table."""
        return ("",)

    @abstractmethod
    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read a file.

        Args:
            path: The file.
            options: The mapping's options; a format uses those that concern it.

        Raises:
            FormatError: If the file is not of this kind, or damaged.
        """


def read_table(path: Path, options: ReadOptions = AUTOMATIC) -> SourceTable:
    """Read a file by the format that its mapping names, or by its ending.

    Raises:
        UsageError: If it does not exist or its kind is not known.
        FormatError: If it cannot be read, or holds no rows.
    """
    kind, name = _kind(path, options)
    with _in_words(path, name):
        table: SourceTable = kind.read(path, options)
    if not table.rows:
        raise FormatError(f"{path} holds no rows of data", "one row or more", "leave it out, or correct the mapping")
    return _without_empty_end(_with_numbers(table))


def _without_empty_end(table: SourceTable) -> SourceTable:
    """Return a table without last rows of zeros alone, the clock's among them: rows that were never filled."""
    numbers = [values.reshape(len(values), -1) for values in table.columns.values() if values.dtype != object]
    if len(numbers) < len(table.columns) or sum(values.shape[1] for values in numbers) < 2:
        return table
    full = np.flatnonzero(np.any([values.any(axis=1) for values in numbers], axis=0))
    end = int(full[-1]) + 1 if len(full) else 0
    rising = any((np.diff(values[:end, 0]) > 0).all() and values[end - 1, 0] > 0 for values in numbers if end > 2)
    if not rising or table.rows - end < 2:
        return table
    columns = {name: values[:end] for name, values in table.columns.items()}
    note = f"{table.path.name}: {table.rows - end} rows at its end hold zeros alone, and are left out"
    return replace(table, columns=columns, notes=(*table.notes, note))


def _with_numbers(table: SourceTable) -> SourceTable:
    """Return a table whose numbers in texts are numbers."""
    found = written_numbers(table.columns)
    columns = {name: values for name, (values, _) in found.items()}
    units = {name: unit for name, (_, unit) in found.items() if unit}
    notes = [f"{table.path.name}: the cells of {name} hold their units; read in {unit}" for name, unit in units.items()]
    return replace(
        table, columns={**table.columns, **columns}, units={**units, **table.units}, notes=(*table.notes, *notes)
    )


def tables_in(path: Path) -> tuple[str, ...]:
    """Return the tables that a file holds, ("",) for one that is a single table; raises as `read_table`."""
    kind, name = _kind(path, AUTOMATIC)
    with _in_words(path, name):
        return kind.tables(path)


def _kind(path: Path, options: ReadOptions) -> tuple[SourceFormat, str]:
    if not path.exists():
        raise UsageError(f"no file {path}", "a file of measured data", "check the path and the mapping's files")
    if path.is_file():
        _refuse_stand_in(path)
    name = options.format or _by_ending(path)
    kind: type[Any] = registry.load(ROOM, BASE, name, SourceFormat)
    return kind(), name


def _refuse_stand_in(path: Path) -> None:
    """Refuse a file that stands for the data and does not hold them.

    Raises:
        FormatError: Naming what it is.
    """
    with path.open("rb") as stream:
        head = stream.read(256).lstrip(b"\xef\xbb\xbf \r\n\t").lower()
    if head.startswith(b"version https://git-lfs"):
        raise FormatError(f"{path} is a pointer of Git LFS", "the file that it points to", "run: git lfs pull")
    if path.suffix.lower() != ".xls" and head.startswith((b"<!doctype html", b"<html")):
        raise FormatError(
            f"{path} is a page of HTML, as of a log-in",
            "a file of measured data",
            "open it in a browser, and download the file again",
        )


def refuse_growth(path: Path, size: float, largest: int = LARGEST) -> None:
    """Refuse a file that is small on the disk and would fill the memory.

    Args:
        path: A file, or a folder that counts as one.
        size: Size of its content once it is read [byte].
        largest: Size that is always read [byte].

    Raises:
        FormatError: With both sizes.
    """
    files = [path] if path.is_file() else [inside for inside in path.rglob("*") if inside.is_file()]
    # A folder counts as a file: a Zarr store is a folder of chunks.
    packed = sum(inside.stat().st_size for inside in files)
    if size > max(largest, DENSEST * packed):
        raise FormatError(
            f"{path} of {packed / 1e6:,.1f} MB grows to {size / 1e6:,.0f} MB when it is read",
            f"at most {DENSEST} times its size, or {largest / 1e6:,.0f} MB",
            "if it is what you recorded, save it without compression, or in parts",
        )


def zipped_size(path: Path) -> int:
    """Return the size of a zip archive's content as its directory states it [byte]; 0 for another file."""
    if not zipfile.is_zipfile(path):
        return 0
    with zipfile.ZipFile(path) as archive:
        return sum(entry.file_size for entry in archive.infolist())


def kind_of_bytes(data: bytes) -> str:
    """Return the kind of file that begins with these bytes, whatever its ending; "" if it is not known."""
    return next((kind for mark, kind in MAGIC.items() if data.startswith(mark)), "")


@contextmanager
def _in_words(path: Path, name: str) -> Iterator[None]:
    """Turn an exception of a library into an error of the file's format."""
    try:
        yield
    except (TacdataError, ModuleNotFoundError):
        raise
    except Exception as error:
        # A damaged file can raise anything in the library that reads it: zlib.error, EOFError, struct.error, ...
        words = " ".join((str(error) or type(error).__name__).split())
        # The library's objects go now: Python 3.12 crashes at its end if a parser is left that stopped half way.
        traceback.clear_frames(error.__traceback__)
        if name == "xlsx":  # the one that parses XML; the collection takes a tenth of a second
            gc.collect()
        raise FormatError(
            f"{path} {_really(path, name)}cannot be read as {name}: {words[:LONGEST]}",
            f"a whole file of the format {name}",
            "copy or save it again; if it is of another kind, name its format in the mapping",
        ) from error


def _really(path: Path, name: str) -> str:
    """Return a file's real kind if it is another than it is read as, as "is a PNG image and "; else ""."""
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        start = stream.read(16)
    kind = kind_of_bytes(start)
    return "is empty and " if not start else f"is {kind} and " if kind and name not in kind else ""


def _markup(path: Path) -> str:
    """Return the kind of a text that a spreadsheet program opens and that is no table of columns; "" for others."""
    with path.open("rb") as stream:
        head = stream.read(1024).lstrip(b"\xef\xbb\xbf \r\n\t").lower()
    if not head.startswith(b"<"):
        return ""
    return "a table in HTML" if b"<html" in head or b"<table" in head else "an XML Spreadsheet"


def is_known(path: Path) -> bool:
    """Return whether the ending of a file says what it is, or that it is not read."""
    return path.name.lower().endswith((*_endings(), *CONVERSIONS))


def _endings() -> dict[str, str]:
    """Return the format of each ending."""
    kinds = {name: registry.load(ROOM, BASE, name, SourceFormat) for name in registry.names(ROOM, BASE)}
    return {ending: name for name, kind in kinds.items() for ending in kind.endings}


def _by_ending(path: Path) -> str:
    endings = _endings()
    # The longest match: .csv.gz is a text, .gz alone would be unknown.
    matches = [ending for ending in endings if path.name.lower().endswith(ending)]
    ending = path.suffix.lower()
    if ending == ".xls" and path.is_file():
        with path.open("rb") as stream:
            kind = kind_of_bytes(stream.read(16))
        if not kind:
            kind = _markup(path)
        if not kind:
            return "csv"  # instruments write tabs and give the file this ending
        if kind == MAGIC[b"PK\x03\x04"]:
            return "xlsx"
        if kind != MAGIC[OLD_OFFICE]:
            words = "open it in Excel or LibreOffice and save it as .xlsx"
            raise UsageError(f"{path} is {kind}", "an Excel workbook (.xls, .xlsx)", words)
    if ending in CONVERSIONS:
        raise UsageError(f"{path}: {ending} is not read", ", ".join(sorted(endings)), CONVERSIONS[ending])
    if not matches:
        raise UsageError(
            f"{path}: the ending {path.suffix or '(none)'} is of no known format",
            ", ".join(sorted(endings)),
            "name the format in the mapping (format: csv), or save the file as one of these",
        )
    return endings[max(matches, key=len)]
