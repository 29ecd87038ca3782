"""Excel workbooks of before 2007 (.xls): as those of today."""

import io
import re
from pathlib import Path
from typing import Any

from tacdata.importing.formats.xlsx import Marks, Xlsx

CONTROL = re.compile(r"[\0-\x08\x0b\x0c\x0e-\x1f]")
"""Signs that no cell of today may hold."""
VISIBLE = 0


class Xls(Xlsx):
    """The sheet that ``table`` names, else the first with numbers, as in a workbook of today."""

    endings = (".xls",)

    def opened(self, path: Path) -> Any:
        """Return the workbook with values, dates, number formats, merged ranges and hidden rows."""
        import openpyxl
        import xlrd

        old, book = xlrd.open_workbook(path, formatting_info=True, logfile=io.StringIO()), openpyxl.Workbook()
        book.remove(book.worksheets[0])
        for source in old.sheets():
            sheet = book.create_sheet(source.name)
            sheet.sheet_state = "visible" if source.visibility == VISIBLE else "hidden"
            for row in range(source.nrows):
                for column, cell in enumerate(source.row(row)):
                    if (value := _value(cell, old.datemode)) is not None:
                        target = sheet.cell(row + 1, column + 1, value)
                        target.number_format = old.format_map[old.xf_list[cell.xf_index].format_key].format_str
            for top, bottom, left, right in source.merged_cells:
                sheet.merge_cells(None, top + 1, left + 1, bottom, right)
            for row, shown in source.rowinfo_map.items():
                sheet.row_dimensions[row + 1].hidden = bool(shown.hidden)
        return book

    def marks(self, path: Path, sheet: Any) -> Marks:
        """Return the merged ranges and the hidden rows of a sheet."""
        ranges = [(r.min_row - 1, r.max_row - 1, r.min_col - 1, r.max_col - 1) for r in sheet.merged_cells.ranges]
        return Marks(tuple(ranges), frozenset(row - 1 for row, shown in sheet.row_dimensions.items() if shown.hidden))


def _value(cell: Any, epoch: int) -> Any:
    """Return a cell's value; ``epoch`` is 1 for dates that count from 1904."""
    import xlrd

    if cell.ctype == xlrd.XL_CELL_DATE:
        moment = xlrd.xldate_as_datetime(cell.value, epoch)
        return moment if cell.value >= 1 else moment.time()
    if cell.ctype == xlrd.XL_CELL_ERROR:
        return xlrd.error_text_from_code.get(cell.value, "#N/A")
    if cell.ctype == xlrd.XL_CELL_BOOLEAN:
        return bool(cell.value)
    if cell.ctype == xlrd.XL_CELL_NUMBER:
        return cell.value or 0.0
    return CONTROL.sub("", cell.value) if isinstance(cell.value, str) and cell.value else cell.value or None
