"""An HTML file with everything inside: text, tables, and pictures as data (`page.html.j2` has its style)."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from functools import cache
from io import BytesIO
from typing import Any, BinaryIO

from jinja2 import Environment, PackageLoader, Template
from markdown_it import MarkdownIt


class HtmlPage:
    """A page that grows from top to bottom; `text` gives the finished file."""

    def __init__(self, title: str, badge: str = "") -> None:
        """Start a page; a badge is a word above the title, such as a verdict's status."""
        self._title, self._badge = title, badge
        self._parts: list[tuple[str, dict[str, Any]]] = []

    def heading(self, words: str, level: int = 2) -> None:
        """Add a heading."""
        self._add("heading", words=words, level=level)

    def paragraph(self, words: str, note: bool = False) -> None:
        """Add a paragraph; a note is set smaller."""
        self._add("paragraph", words=words, note=note)

    def table(
        self,
        heads: Sequence[str],
        rows: Sequence[Sequence[Any]],
        bold: Callable[[int, int], bool] = lambda row, column: False,
        words: bool = False,
    ) -> None:
        """Add a table.

        Args:
            heads: Titles of the columns.
            rows: Rows of as many cells.
            bold: Called with row and column; true for bold cells.
            words: Cells are words, set to the left; else numbers, set to the right.
        """
        marked = [[(cell, bold(number, k)) for k, cell in enumerate(row)] for number, row in enumerate(rows)]
        self._add("table", heads=heads, rows=marked, words=words)

    def items(self, lines: Sequence[str], note: bool = False) -> None:
        """Add a list."""
        self._add("items", lines=lines, note=note)

    def tiles(self, tiles: Sequence[tuple[str, str]]) -> None:
        """Add figures in large print, each a name and a value."""
        self._add("tiles", tiles=tiles)

    def markdown(self, text: str) -> None:
        """Add Markdown, its headings one level lower."""
        converter = MarkdownIt("js-default")
        tokens = converter.parse(text)
        for token in tokens:
            if token.type.startswith("heading"):
                token.tag = f"h{min(int(token.tag[1:]) + 1, 6)}"
        self._add("html", html=converter.renderer.render(tokens, converter.options, {}))

    def picture(self, draw: Callable[[BinaryIO], object], words: str) -> None:
        """Add a PNG that ``draw`` writes to a stream; ``words`` are its caption."""
        stream = BytesIO()
        draw(stream)
        if stream.getvalue():
            self._add("picture", words=words, data=base64.b64encode(stream.getvalue()).decode("ascii"))
            self.paragraph(words, note=True)

    def _add(self, kind: str, **part: Any) -> None:
        self._parts.append((kind, part))

    @property
    def text(self) -> str:
        """The file."""
        return _template().render(title=self._title, badge=self._badge, parts=self._parts)


@cache
def _template() -> Template:
    sources = PackageLoader("tacdata.training", "reports")
    environment = Environment(loader=sources, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.get_template("page.html.j2")
