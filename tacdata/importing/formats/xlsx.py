"""Excel workbooks (.xlsx): one sheet as a table, its cells as Excel last computed them."""

import csv
import io
import re
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, time
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.csv import table_of
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth, zipped_size
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.importing.text.stated_rate import stated_rate
from tacdata.importing.units import OTHERS, plain, quantity_of

TABS = ReadOptions(delimiter="tab", decimal=".")
MERGED = re.compile(rb'<(?:\w+:)?mergeCell [^>]*ref="([A-Z]+\d+:[A-Z]+\d+)"')
HIDDEN = re.compile(rb'<(?:\w+:)?row [^>]*hidden="(?:1|true)"[^>]*>')
NUMBERED = re.compile(rb'\br="(\d+)"')
"""How a sheet marks merged ranges, hidden rows and the number of a row."""
SHOWN_UNIT = re.compile(r'[0#?]\\? ?"([^"]+)"')
"""A text behind the digits of a number format."""
MOST_MARKED = 300_000_000
"""Largest sheet whose marks are read [byte]."""
LARGEST_SHEETS = 32 * 1024 * 1024
"""Size of sheets that are always read [byte]; larger ones may be compressed as far as real ones are."""
HEAD, HEAD_BYTES = 60, 4096
"""Rows of a sheet that tell whether it holds numbers, and bytes of another one that may state a rate."""


@dataclass(frozen=True)
class Marks:
    """Properties of a sheet other than the values of its cells."""

    merged: tuple[tuple[int, int, int, int], ...] = ()
    """First and last row and column of each merged range, from 0."""
    hidden: frozenset[int] = frozenset()
    """Rows that a filter or a person hides, from 0."""


class Xlsx(SourceFormat):
    """The sheet that ``table`` names, else the first with numbers; headers and units as in a text file."""

    endings = (".xlsx", ".xlsm")

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the sheets whose first rows hold numbers, if there are several; see the base."""
        book, titles = self.opened(path), []
        try:
            for sheet in [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"]:
                with suppress(FormatError):
                    table_of(path, _as_text(sheet, Marks(), [], HEAD), TABS, [])
                    titles.append(sheet.title)
        finally:
            book.close()
        return tuple(titles) if len(titles) > 1 else ("",)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read a sheet; dates come as ISO 8601. See the base."""
        book = self.opened(path)
        try:
            if (sheet_name := options.table) and sheet_name not in book.sheetnames:
                allowed = ", ".join(book.sheetnames)
                raise FormatError(f"{path}: no sheet {sheet_name}", allowed, "correct table in the mapping")
            table, read, remainder = _first_table(path, book, options, self.marks)
        finally:
            book.close()
        notes = [*table.notes, *[f"{path.name}: sheet {read} is read, not {', '.join(remainder)}"] * bool(remainder)]
        columns = [values for values in table.columns.values() if values.dtype != object]
        if zipped_size(path) and any(not np.isfinite(values).any() for values in columns):
            notes += _never_computed(path, read)
        return replace(table, notes=tuple(notes))

    def opened(self, path: Path) -> Any:
        """Return a file's workbook, whose sheets give their rows."""
        from openpyxl import load_workbook

        refuse_growth(path, zipped_size(path), LARGEST_SHEETS)
        # As bytes: openpyxl refuses a workbook of today by the ending .xls.
        book = load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # programs other than Excel write wrong ones, by which rows would be cut off
        return book

    def marks(self, path: Path, sheet: Any) -> Marks:
        """Return the merged ranges and the hidden rows of a sheet."""
        from openpyxl.utils import range_boundaries

        name = str(getattr(sheet, "_worksheet_path", "")).lstrip("/")
        with zipfile.ZipFile(path) as archive:
            if name not in archive.namelist() or archive.getinfo(name).file_size > MOST_MARKED:
                return Marks()
            text = archive.read(name)
        merged = []
        for match in MERGED.finditer(text):
            left, top, right, bottom = range_boundaries(match[1].decode())
            merged.append((top - 1, bottom - 1, left - 1, right - 1))
        rows = (NUMBERED.search(match[0]) for match in HIDDEN.finditer(text))
        return Marks(tuple(merged), frozenset(int(match[1]) - 1 for match in rows if match))


def _first_table(
    path: Path, book: Any, options: ReadOptions, marks: Callable[[Path, Any], Marks]
) -> tuple[SourceTable, str, list[str]]:
    """Return the sheet that is meant, else the first with rows of numbers; its name, and those of other full sheets."""
    sheet_name, refused, sheets, notes = options.table, None, {}, {}
    visible = [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"]
    for sheet in [book[sheet_name]] if sheet_name else visible or book.worksheets:
        notes[sheet.title] = []
        if text := _as_text(sheet, marks(path, sheet), notes[sheet.title]):
            sheets[sheet.title] = text
    hidden = [sheet.title for sheet in book.worksheets if sheet not in visible and sheet.title != sheet_name]
    for name, data, decimal in [(name, data, decimal) for decimal in ".," for name, data in sheets.items()]:
        try:
            formats = _units_of_formats(book[name])
            tabs = replace(options, delimiter=TABS.delimiter, decimal=decimal)
            table = table_of(path, data, tabs, [f"{path.name}: {note}" for note in notes[name]])
        except FormatError as error:
            refused = refused or error
            continue
        units = {name: unit for name, unit in zip(table.columns, formats, strict=False) if unit}
        others = [text[:HEAD_BYTES].decode("utf-8", "ignore") for title, text in sheets.items() if title != name]
        rate = next(filter(None, [table.rate, *(stated_rate(text, len(text)) for text in others)]), 0.0)
        table = replace(table, units={**units, **table.units}, rate=rate)
        return table, name, [*(title for title in sheets if title != name), *(f"{title} (hidden)" for title in hidden)]
    raise FormatError(
        f"{path}: no sheet with rows of numbers ({', '.join(sheets)})" if refused else f"{path} holds no rows",
        "a sheet with a header and rows",
        "leave it out, or name the sheet by table and its first lines by skip",
    )


def _units_of_formats(sheet: Any) -> list[str]:
    """Return the unit that the number format of each column shows behind its numbers, as 0.0" um" does; "" for none."""
    units: list[str] = []
    for row in sheet.iter_rows(max_row=HEAD):
        for number, cell in enumerate(row):
            units += [""] * (number + 1 - len(units))
            if isinstance(cell.value, int | float) and (match := SHOWN_UNIT.search(str(cell.number_format))):
                unit = match[1].strip()
                if quantity_of(unit) or plain(unit).lower() in OTHERS:
                    units[number] = plain(unit)
    return units


def _as_text(sheet: Any, marks: Marks, notes: list[str], limit: int | None = None) -> bytes:
    """Return a sheet's rows as text with tabs between cells; empty if no cell is full.

    A merged cell fills its range. Hidden rows are left out and counted in ``notes``.
    """
    text = io.StringIO()
    rows = [[_text(cell) for cell in row] for row in sheet.iter_rows(values_only=True, max_row=limit)]
    width = max(map(len, rows), default=0)
    rows = [[*row, *[""] * (width - len(row))] for row in rows]
    for top, bottom, left, right in marks.merged:
        for row in rows[top : bottom + 1]:
            # The file holds a merged range's value in its top left cell only. That cell may be in a hidden row, so
            # ranges are filled before those are left out.
            row[left : right + 1] = [rows[top][left]] * len(row[left : right + 1])
    visible_rows = [row for number, row in enumerate(rows) if number not in marks.hidden]
    if len(visible_rows) < len(rows):
        notes.append(
            f"{len(rows) - len(visible_rows)} hidden rows are left out; show them and save it again to import them"
        )
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(visible_rows)
    return text.getvalue().encode() if any(map(any, visible_rows)) else b""


def _never_computed(path: Path, sheet: str) -> list[str]:
    """Return a note on formulas without a value: a program wrote them, and no spreadsheet ever computed them."""
    from openpyxl import load_workbook

    # Without data_only the cells are the formulas themselves.
    book = load_workbook(io.BytesIO(path.read_bytes()), read_only=True)
    try:
        book[sheet].reset_dimensions()
        cells = [cell for row in book[sheet].iter_rows(values_only=True) for cell in row]
    finally:
        book.close()
    count = sum(isinstance(cell, str) and cell.startswith("=") for cell in cells)
    words = "were never computed and have no value; save it in a spreadsheet program"
    return [f"{path.name}: {count} formulas {words}"] if count else []


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, str):
        return " ".join(cell.split())  # a header may have a line break between name and unit
    if isinstance(cell, datetime | time):
        return cell.isoformat(*([" "] if isinstance(cell, datetime) else []))
    return repr(cell) if isinstance(cell, float) else str(cell)
