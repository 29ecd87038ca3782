"""Excel workbooks: one sheet as a table, its cells as Excel last computed them."""

from __future__ import annotations

import csv
import io
from datetime import datetime, time
from pathlib import Path
from typing import Any

from tacdata.errors import FormatError
from tacdata.importing.formats.csv import table_of
from tacdata.importing.formats.source_format import SourceFormat, SourceTable


class Xlsx(SourceFormat):
    """The sheet that ``table`` names, else the first with numbers; headers and units as in a text file."""

    endings = (".xlsx", ".xlsm")

    def read(self, path: Path, options: dict[str, Any]) -> SourceTable:
        """Read a sheet; dates come as ISO 8601. See the base."""
        from openpyxl import load_workbook

        book = load_workbook(path, read_only=True, data_only=True)
        try:
            if (wanted := options.get("table")) and wanted not in book.sheetnames:
                allowed = ", ".join(book.sheetnames)
                raise FormatError(f"{path}: no sheet {wanted}", allowed, "correct table in the mapping")
            sheets = [book[wanted]] if wanted else [s for s in book.worksheets if s.max_row and s.max_row > 1]
            if not sheets:
                raise FormatError(f"{path} holds no rows", "a sheet with a header and rows", "leave it out")
            text = io.StringIO()
            writer = csv.writer(text, delimiter="\t", lineterminator="\n")
            writer.writerows([_text(cell) for cell in row] for row in sheets[0].iter_rows(values_only=True))
        finally:
            book.close()
        table = table_of(path, text.getvalue().encode(), {**options, "delimiter": "tab", "decimal": "."}, [])
        others = [sheet.title for sheet in sheets[1:]]
        note = (f"{path.name}: sheet {sheets[0].title} is read, not {', '.join(others)}",) if others else ()
        return SourceTable(path, table.columns, table.units, (*table.notes, *note))


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, datetime | time):
        return cell.isoformat(*([" "] if isinstance(cell, datetime) else []))
    return repr(cell) if isinstance(cell, float) else str(cell)
