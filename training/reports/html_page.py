"""One HTML file with everything inside: text, tables, and pictures as data."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable
from io import BytesIO
from typing import BinaryIO

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1f24; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; margin-top: 2.2rem; border-bottom: 1px solid #d0d7de; }
h3 { font-size: 1.05rem; margin-top: 1.5rem; }
table { border-collapse: collapse; margin: .6rem 0 1rem; font-variant-numeric: tabular-nums; font-size: .88rem; }
th, td { padding: .2rem .55rem; border-bottom: 1px solid #e4e8ec; text-align: right; }
th:first-child, td:first-child { text-align: left; } th { border-bottom: 1px solid #6e7781; }
img { max-width: 100%; } p.note { color: #57606a; font-size: .85rem; } td.better { font-weight: 600; }
"""


class HtmlPage:
    """A page that grows from top to bottom; `text` gives the finished file."""

    def __init__(self, title: str) -> None:
        """Start a page."""
        self._title, self._parts = title, [f"<h1>{html.escape(title)}</h1>"]

    def heading(self, words: str, level: int = 2) -> None:
        """Add a heading."""
        self._parts.append(f"<h{level}>{html.escape(words)}</h{level}>")

    def paragraph(self, words: str, note: bool = False) -> None:
        """Add a paragraph; a note is set smaller."""
        self._parts.append(f"<p{' class=note' if note else ''}>{html.escape(words)}</p>")

    def table(self, heads: list[str], rows: list[list[str]], bold: Callable[[int, int], bool] | None = None) -> None:
        """Add a table of cells as text.

        Args:
            heads: Titles of the columns.
            rows: Rows of as many cells.
            bold: Called with row and column; says which cells are set bold.
        """
        lines = ["<table>", _row("th", heads)]
        for number, cells in enumerate(rows):
            marks = [" class=better" if bold and bold(number, k) else "" for k in range(len(cells))]
            lines.append(_row("td", cells, marks))
        self._parts.append("\n".join([*lines, "</table>"]))

    def markdown(self, text: str) -> None:
        """Add a page of our own Markdown: headings, paragraphs, list items and tables, nothing else."""
        table: list[list[str]] = []
        for line in [*text.splitlines(), ""]:
            if line.startswith("|"):
                cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
                if not all(re.fullmatch(r":?-+:?", cell) for cell in cells):
                    table.append([cell.replace("`", "") for cell in cells])
                continue
            if table:
                self.table(table[0], table[1:])
                table = []
            if line.startswith("#"):
                level = len(line) - len(line.lstrip("#"))
                self.heading(line.lstrip("# ").replace("`", ""), min(level + 1, 6))
            elif line.strip():
                self.paragraph(line.removeprefix("- ").replace("`", ""))

    def picture(self, draw: Callable[[BinaryIO], object], words: str) -> None:
        """Add a PNG that ``draw`` writes to a stream; ``words`` say what it shows."""
        stream = BytesIO()
        draw(stream)
        data = base64.b64encode(stream.getvalue()).decode("ascii")
        if data:
            told = html.escape(words, quote=True)
            self._parts.append(f'<figure><img alt="{told}" src="data:image/png;base64,{data}"></figure>')
            self.paragraph(words, note=True)

    @property
    def text(self) -> str:
        """The file."""
        head = f'<meta charset="utf-8"><title>{html.escape(self._title)}</title><style>{STYLE}</style>'
        body = "\n".join(self._parts)
        return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _row(kind: str, cells: list[str], marks: list[str] | None = None) -> str:
    inside = (
        f"<{kind}{mark}>{html.escape(cell)}</{kind}>"
        for cell, mark in zip(cells, marks or [""] * len(cells), strict=True)
    )
    return f"<tr>{''.join(inside)}</tr>"
