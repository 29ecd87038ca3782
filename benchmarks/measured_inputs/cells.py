"""Kind 5: headers and cells whose place misleads: merged, hidden, counted, shifted or in another order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from truth import NAMES, measured, presses, texts, write


def _book(folder: Path, rows: list[list[Any]], file: str = "run.xlsx") -> Any:
    from openpyxl import Workbook

    book = Workbook()
    for row in rows:
        book.active.append(row)
    book.save(folder / file)
    return book


@measured(5)
def names_of_rows(folder: Path) -> None:
    """R's write.table: a column of row names that the header lacks; no column is taken for its neighbour."""
    cells = [[f'"{k + 1}"', *row] for k, row in enumerate(texts(presses()))]
    write(folder, cells, tuple(f'"{n}"' for n in ("t", "depth", "c0", "c1")), mark=" ")


@measured(5, recordings=6)
def order_by_file(folder: Path) -> None:
    """Columns in another order in the second file: by name."""
    write(folder, presses(), file="run_1.csv")
    write(folder, presses(seed=1)[:, [0, 3, 2, 1]], tuple(NAMES[k] for k in (0, 3, 2, 1)), file="run_2.csv")


@measured(5, recordings=6)
def signs_by_file(folder: Path) -> None:
    """Decimal commas and semicolons in the second file: each by its own signs."""
    write(folder, presses(), file="run_1.csv")
    cells = [[field.replace(".", ",") for field in row] for row in texts(presses(seed=1))]
    write(folder, cells, file="run_2.csv", mark=";")


@measured(5, told="header|column|not read|no name")
def second_without_header(folder: Path) -> None:
    """The second file goes on without a header: its rows are no trial without names."""
    rows = presses()
    write(folder, rows[:150], file="run_1.csv")
    write(folder, rows[150:], (), file="run_2.csv")


@measured(5, told="formula|no value|missing|depth")
def formulas_alone(folder: Path) -> None:
    """Formulas without stored values for the depth: refused, or told as missing."""
    rows = presses()
    cells = [[r[0], f"=E{k + 2}/1000", r[2], r[3], r[1] * 1000] for k, r in enumerate(rows.tolist())]
    _book(folder, [[*NAMES, "raw"], *cells])


@measured(5)
def numbers_as_texts(folder: Path) -> None:
    """Numbers as texts in Excel, with decimal commas: numbers, or refused."""
    _book(folder, [list(NAMES), *[[field.replace(".", ",") for field in row] for row in texts(presses())]])


@measured(5, needed="left out|total|time goes back|mean|out of line")
def totals_below(folder: Path) -> None:
    """A row of totals below an Excel table (mean of each column): no row of data."""
    rows = presses()
    _book(folder, [list(NAMES), *rows.tolist(), rows.mean(axis=0).tolist()])


@measured(5, needed="spread|merged")
def merged_times(folder: Path) -> None:
    """Times in merged cells, one for five rows: the rows are spread, told."""
    rows = presses().tolist()
    book = _book(folder, [list(NAMES), *rows])
    for first in range(2, len(rows) + 1, 5):
        book.active.merge_cells(f"A{first}:A{min(first + 4, len(rows) + 1)}")
    book.save(folder / "run.xlsx")


@measured(5, needed="hidden")
def hidden_for_good(folder: Path) -> None:
    """A first sheet that is hidden for good holds an older run: the shown one."""
    from openpyxl import Workbook

    book = Workbook()
    for number, scale in ((0, 3.0), (1, 1.0)):
        sheet = book.active if not number else book.create_sheet("Run")
        sheet.append(list(NAMES))
        for row in (presses() * [1, scale, 1, 1]).tolist():
            sheet.append(row)
    book.worksheets[0].sheet_state = "veryHidden"
    book.active = 1
    book.save(folder / "run.xlsx")


@measured(5, needed="hidden")
def hidden_column(folder: Path) -> None:
    """Columns that are hidden in Excel hold the raw depth of another tare: told."""
    rows = presses()
    book = _book(folder, [["t [s]", "depth [mm]", "c0 [pF]", "c1 [pF]", "depth raw [mm]"],
                          *np.column_stack([rows, rows[:, 1] + 7]).tolist()])  # fmt: skip
    book.active.column_dimensions["E"].hidden = True
    book.save(folder / "run.xlsx")


@measured(5, needed="hidden|filter")
def filtered_rows(folder: Path) -> None:
    """Rows that a filter hides (every reading with c1 above 10.4): told."""
    rows = presses().tolist()
    book = _book(folder, [list(NAMES), *rows])
    book.active.auto_filter.ref = f"A1:D{len(rows) + 1}"
    for number, row in enumerate(rows, 2):
        book.active.row_dimensions[number].hidden = 100 < number < 160
        del row
    book.save(folder / "run.xlsx")


@measured(5, recordings=6)
def encodings_by_file(folder: Path) -> None:
    """UTF-16 with tabs (Unicode text of Excel), file by file beside UTF-8."""
    write(folder, presses(), file="run_1.csv")
    write(folder, presses(seed=1), file="run_2.csv", mark="\t", encoding="utf-16")


@measured(5)
def separator_line(folder: Path) -> None:
    """Sep=; in the first line, as Excel writes it."""
    write(folder, [[f.replace(".", ",") for f in row] for row in texts(presses())], mark=";", head="sep=;\n")


@measured(5)
def names_of_pandas(folder: Path) -> None:
    """Two lines of names (pandas' MultiIndex) and a line with the index's name."""
    import pandas

    rows = presses()
    frame = pandas.DataFrame(rows[:, 1:], index=pandas.Index(rows[:, 0], name="t [s]"),
                             columns=pandas.MultiIndex.from_tuples(
                                 [("stage", "depth [mm]"), ("board", "c0 [pF]"), ("board", "c1 [pF]")]))  # fmt: skip
    frame.to_csv(folder / "run.csv")


@measured(5)
def raw_and_filtered(folder: Path) -> None:
    """Raw and filtered values of each channel under merged names: four channels with their group's name."""
    rows = presses()
    head = "Time,Stage,c0,,c1,\ns,mm,raw,filtered,raw,filtered\n"
    write(folder, rows[:, [0, 1, 2, 2, 3, 3]], (), head=head)


@measured(5)
def notes_with_breaks(folder: Path) -> None:
    """Notes with commas and line breaks in quotes in the last column: rows keep their columns."""
    cells = [[*row, '"ok"'] for row in texts(presses())]
    cells[60][4] = '"operator: door opened,\nclosed again, then went on"'
    cells[170][4] = '"he said ""go"", so"'
    write(folder, cells, (*NAMES, "note"))


@measured(5)
def table_in_markdown(folder: Path) -> None:
    """Columns between bars with a line of dashes (Markdown)."""
    lines = [f"| {' | '.join(NAMES)} |", "|---|---|---|---|", *(f"| {' | '.join(r)} |" for r in texts(presses()))]
    (folder / "run.txt").write_text("\n".join(lines) + "\n")


@measured(5, told="another number of columns|left out|column")
def touching_columns(folder: Path) -> None:
    """Columns of a fixed width whose wide numbers touch (-10.00000-11.00000): refused or counted, none shifted."""
    rows = presses() * [1, 1, -1, -1]
    lines = ["        t    depth        c0        c1",
             *("".join(f"{v:10.5f}" if k < 2 else f"{v:9.5f}" for k, v in enumerate(r)) for r in rows)]  # fmt: skip
    (folder / "run.txt").write_text("\n".join(lines) + "\n")
