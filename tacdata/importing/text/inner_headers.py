"""Headers among the rows: repeated ones are left out, and a header of another table is refused."""

import re
from pathlib import Path
from typing import Any

from tacdata.errors import FormatError
from tacdata.importing.text.layout import MISSING, TextLayout, are_units, is_number
from tacdata.importing.units import quantity_of, split_unit


def without_headers(table: Any, layout: TextLayout, path: Path) -> tuple[Any, int]:
    """Return an Arrow table of texts without rows that repeat its header, and their number.

    Raises:
        FormatError: If a row is the header of another table, whose columns mean something else.
    """
    numeric = [name for name, kind in zip(layout.names, layout.kinds, strict=True) if kind != "text"]
    if len(numeric) < 2:
        return table, 0
    texts = {name: table.column(name).to_pylist() for name in numeric}
    worded = [row for row, text in enumerate(texts[numeric[0]]) if _is_word(text, layout)]
    rows = [row for row in worded if all(_is_word(texts[name][row], layout) for name in numeric)]
    repeated = []
    for row in rows:
        fields = {name: str(texts[name][row]).strip() for name in numeric}
        if all(_repeats(name, field, layout) for name, field in fields.items()):
            repeated.append(row)
        elif _is_header(list(fields.values()), layout) or are_units(list(fields.values())):
            words = f"the header of another table, or has other units ({', '.join(fields.values())})"
            raise FormatError(
                f"{path}: row {row + 1} of the data is {words}",
                f"one table a file, here of {', '.join(numeric)}",
                "save each table as a file of its own",
            )
    if not repeated:
        return table, 0
    return table.take([row for row in range(table.num_rows) if row not in set(repeated)]), len(repeated)


def _is_word(text: str | None, layout: TextLayout) -> bool:
    if text is None or text.strip() in MISSING or is_number(text.strip(), layout.decimal):
        return False
    return bool(re.search(r"[^\W\d_]", text))


def _repeats(name: str, field: str, layout: TextLayout) -> bool:
    """Return whether a field repeats a column's name, with or without its unit, or its unit alone."""
    bare = {name, split_unit(name)[0], name.rstrip("'")}
    unit = layout.units.get(name, "")
    same_unit = not split_unit(field)[1] or split_unit(field)[1] == unit
    return (bool({field, split_unit(field)[0]} & bare) and same_unit) or field.strip("[]() ") == unit


def _is_header(fields: list[str], layout: TextLayout) -> bool:
    """Return whether words are names of columns: different ones, half of them with a unit or known as names."""
    known = {split_unit(name)[0] for name in layout.names}
    names = [bool(quantity_of(split_unit(field)[1])) or split_unit(field)[0] in known for field in fields]
    return len(set(fields)) == len(fields) and 2 * sum(names) >= len(fields)
