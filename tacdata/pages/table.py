"""Tables that a reader sorts and filters."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from tacdata.pages.number import in_print

NUMBER = re.compile(r"[<+−-]? ?\d[\d.,]*(e[-+]?\d+)?( |$)")
"""Beginning of a cell that is a number, with a unit or an interval behind it."""
FILTERED = 9
"""Rows from which a table has a field to filter them."""


@dataclass(frozen=True)
class Cell:
    """A cell of a table."""

    value: Any
    """Words, or a number; None and numbers that are not finite are set as a dash."""
    strong: bool = False
    """Whether it is set bold."""
    bad: bool = False
    """Whether it is out of tolerance."""
    heat: float | None = None
    """Depth of its colour [1], 0 to 1; None for none."""

    @property
    def words(self) -> str:
        """What is printed."""
        return in_print(self.value)

    @property
    def order(self) -> str:
        """The value to sort by where it is a number; empty for words."""
        # The printed words cannot be sorted: they are rounded and have units.
        number = isinstance(self.value, int | float) and math.isfinite(self.value)
        return repr(float(self.value)) if number else ""

    @property
    def classes(self) -> str:
        """Classes of the style sheet."""
        kinds = (("strong", self.strong), ("bad", self.bad), ("heat", self.heat is not None))
        return " ".join(name for name, holds in kinds if holds)


@dataclass(frozen=True)
class Table:
    """A table. Columns of numbers are set to the right."""

    heads: Sequence[str]
    """Title of each column, with its unit."""
    rows: Sequence[Sequence[Any]]
    """Rows of as many cells: words, numbers or `Cell`."""
    title: str = ""
    """Caption."""
    kind: ClassVar[str] = "table"

    @property
    def cells(self) -> list[list[Cell]]:
        """The rows as cells."""
        return [[value if isinstance(value, Cell) else Cell(value) for value in row] for row in self.rows]

    @property
    def filtered(self) -> bool:
        """Whether there are rows enough to be filtered; a map of values is not."""
        return len(self.rows) >= FILTERED and not self.heated

    @property
    def heated(self) -> bool:
        """Whether cells have a colour by their value."""
        return any(cell.heat is not None for row in self.cells for cell in row)

    @property
    def numeric(self) -> list[bool]:
        """Whether a column begins with a number in most of its cells."""
        # By most of its cells: a column of numbers may have a dash or a remark here and there.
        columns = zip(*self.cells, strict=True) if self.rows else ([] for _ in self.heads)
        return [2 * sum(_numeric(cell.words) for cell in column) > len(column) for column in map(list, columns)]


def _numeric(words: str) -> bool:
    return words in ("", "–") or bool(NUMBER.match(words))
