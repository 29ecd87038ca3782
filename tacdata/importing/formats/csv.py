"""Text files of columns: CSV, TSV, semicolons, blanks; with or without a header; point or comma as decimal sign."""

from __future__ import annotations

import gzip
import io
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.source_format import SourceFormat, SourceTable
from tacdata.importing.text_layout import COMMENTS, MISSING, TextLayout, is_comment, is_number, text_layout

SNIFFED = 256 * 1024
"""Bytes from which the layout is recognized."""


class Csv(SourceFormat):
    """Columns of text."""

    endings = (".csv", ".tsv", ".txt", ".dat", ".asc", ".csv.gz", ".txt.gz", ".tsv.gz")

    def read(self, path: Path, options: dict[str, Any]) -> SourceTable:
        """Read the file by Arrow's reader, with the layout of `text_layout`; see the base class."""
        data, notes = _decoded(path, options)
        return table_of(path, data, options, notes)


def table_of(path: Path, data: bytes, options: dict[str, Any], notes: list[str]) -> SourceTable:
    """Return text in UTF-8 as a table.

    Args:
        path: Where it comes from, for messages.
        data: The text.
        options: What the mapping says of it; see `SourceFormat.read`.
        notes: What is known already; notes on the rows are added.

    Raises:
        FormatError: If it has no rows of numbers.
    """
    layout = text_layout(data[:SNIFFED].decode("utf-8", "ignore"), options, str(path))
    own = tuple(str(text) for text in options.get("missing", ()) if isinstance(text, str))
    body, comments = _body(data, layout, own)
    if comments:
        notes.append(f"{path.name}: {comments} comment lines among the rows are left out")
    if not body.strip():
        raise FormatError(f"{path} has a header and no row", "one row of data or more", "leave it out")
    columns, skipped = _parsed(body, layout, [*MISSING, *own], path)
    if skipped:
        notes.append(f"{path.name}: {skipped} lines with another number of columns are left out")
    return SourceTable(path, columns, dict(layout.units), tuple(notes))


def _decoded(path: Path, options: dict[str, Any]) -> tuple[bytes, list[str]]:
    """Return the file's text in UTF-8 with plain line ends."""
    raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    if b"\0" in raw[:4096] and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FormatError(
            f"{path} is not text", "a text file of columns", "name its format in the mapping (format: ...)"
        )
    notes: list[str] = []
    if encoding := options.get("encoding"):
        try:
            raw = raw.decode(encoding).encode()
        except (UnicodeDecodeError, LookupError) as error:
            raise FormatError(f"{path}: {error}", "the file's encoding", "correct encoding in the mapping") from None
    elif raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raw = raw.decode("utf-16").encode()
    else:
        try:
            raw.decode()
        except UnicodeDecodeError:
            raw = raw.decode("latin-1").encode()
            notes.append(f"{path.name}: not UTF-8, read as Latin-1")
    return raw.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n"), notes


def _body(data: bytes, layout: TextLayout, missing: tuple[str, ...]) -> tuple[bytes, int]:
    """Return the rows without comments, and how many comments stood among them."""
    start, comments = 0, 0
    for _ in range(layout.skip):
        start = data.index(b"\n", start) + 1
    body = data[start:]
    marks = tuple(mark.encode() for mark in COMMENTS)
    if any(mark in body for mark in marks):
        lines = body.split(b"\n")
        kept = [line for line in lines if not is_comment(line.decode("utf-8", "ignore"), missing)]
        body, comments = b"\n".join(kept), len(lines) - len(kept)
    if layout.delimiter == " ":
        body = b"\n".join(b" ".join(line.split()) for line in body.split(b"\n"))
    return body, comments


def _parsed(body: bytes, layout: TextLayout, missing: list[str], path: Path) -> tuple[dict[str, np.ndarray], int]:
    """Parse with the column types of the layout; if a text stands among numbers, report where."""
    import pyarrow as pa

    kinds = {"float": pa.float64(), "int": pa.int64(), "text": pa.string()}
    types = {name: kinds[kind] for name, kind in zip(layout.names, layout.kinds, strict=True)}
    try:
        table, skipped = _arrow(body, layout, missing, types)
    except pa.ArrowInvalid:
        table, skipped = _arrow(body, layout, missing, dict.fromkeys(layout.names, pa.string()))
    columns = {}
    for name, kind in zip(layout.names, layout.kinds, strict=True):
        column = table.column(name)
        if kind == "text" or not pa.types.is_string(column.type):
            columns[name] = _array(column, kind)
        else:
            columns[name] = _numbers(column.to_pylist(), layout, name, path)
    return columns, skipped


def _arrow(body: bytes, layout: TextLayout, missing: list[str], types: dict[str, Any]) -> tuple[Any, int]:
    from pyarrow import csv

    skipped: list[int] = []

    def other_width(row: Any) -> str:
        skipped.append(1)
        return "skip"

    table = csv.read_csv(
        io.BytesIO(body),
        csv.ReadOptions(column_names=list(layout.names), use_threads=False),
        csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=other_width),
        csv.ConvertOptions(
            column_types=types, null_values=missing, strings_can_be_null=True, decimal_point=layout.decimal
        ),
    )
    return table, len(skipped)


def _array(column: Any, kind: str) -> np.ndarray:
    if kind == "text":
        return np.array(column.to_pylist(), dtype=object)
    if kind == "int" and not column.null_count:
        return column.to_numpy()
    return np.asarray(column.to_numpy(), dtype=float)


def _numbers(texts: list[str | None], layout: TextLayout, name: str, path: Path) -> np.ndarray:
    values = np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        if text is None:
            continue
        if not is_number(text.strip(), layout.decimal):
            raise FormatError(
                f"{path}: column {name}, row {row + 1} of the data: {text!r}",
                f"a number with a decimal {'comma' if layout.decimal == ',' else 'point'}",
                f"add {text.strip()!r} to missing in the mapping if it stands for no value, else correct the file",
            )
        field = text.strip()
        values[row] = np.nan if field in MISSING else float(field.replace(",", ".") if layout.decimal == "," else field)
    return values
