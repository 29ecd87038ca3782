"""Numbers and words of a trial that its mapping gives: constant, from a path, or from a column."""

import re

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import Axis, KnownValue, Value
from tacdata.importing.source_table import SourceTable, axis, single
from tacdata.importing.units import factor

LENGTHS, ANGLES = ("x", "y", "z", "depth"), ("yaw", "tilt_x", "tilt_y")
UNITS = {**dict.fromkeys(LENGTHS, "mm"), **dict.fromkeys(ANGLES, "deg"), "speed": "mm/s", "hold": "s"}


def known_numbers(
    entries: dict[str, Value], tables: dict[str, SourceTable], parts: dict[str, str], section: str
) -> dict[str, float]:
    """Return the numbers that a mapping gives for a trial: constant, from the path, or the median of a column."""
    values = {}
    for name, entry in entries.items():
        where, unit = f"{section}: {name}", UNITS[name]
        if isinstance(entry, int | float):
            values[name] = float(entry)
        elif entry.part:
            scale = factor(entry.unit, unit, where) if entry.unit else 1.0
            values[name] = _number(_part(entry, parts, where), where) * scale
        else:
            column = axis(_table(entry, tables, where), Axis(entry.column, entry.unit), unit, where)
            values[name] = float(np.nanmedian(column))
    return values


def label_of(entry: str | KnownValue, tables: dict[str, SourceTable], parts: dict[str, str], where: str) -> str:
    """Return a word of a trial: constant, from the path, or the most frequent one of a column.

    Args:
        entry: The word, or its place.
        tables: Name under ``files`` -> rows of the trial.
        parts: {part} of the paths -> its text.
        where: The mapping's key, for messages.

    Raises:
        FormatError: If there is no such part, column or match.
    """
    if isinstance(entry, str):
        return entry
    if entry.part:
        return _part(entry, parts, where)
    table = _table(entry, tables, where)
    values = table.column(single(table, entry.column, where))
    if values.dtype == object:
        words = [str(value).strip() for value in values.tolist() if value is not None and str(value).strip()]
    else:
        numbers = values.astype(float)
        words = [f"{value:g}" for value in numbers[np.isfinite(numbers)]]
    if not words:
        raise FormatError(f"{where}: a column without a value", "a word or a number", "name another column")
    return max(dict.fromkeys(words), key=words.count)


def _table(entry: KnownValue, tables: dict[str, SourceTable], where: str) -> SourceTable:
    """Return the file in which a trial's number or word is; raises FormatError if there is none of that name."""
    name = entry.file or next(iter(tables))
    if name not in tables:
        raise FormatError(f"{where}: file {name!r}", ", ".join(tables), "name one under files")
    return tables[name]


def _part(entry: KnownValue, parts: dict[str, str], where: str) -> str:
    """Return a {part} of the path, or the piece of it that a pattern finds.

    Raises:
        FormatError: If there is no such part, or the pattern is wrong or finds nothing.
    """
    if entry.part not in parts:
        listed = ", ".join(parts) or "none: no path has a {part}"
        raise FormatError(f"{where}: part {entry.part!r}", listed, "correct part")
    text, pattern = parts[entry.part], entry.pattern
    if not pattern:
        return text
    try:
        match = re.search(pattern, text)
    except re.error as error:
        raise FormatError(f"{where}: pattern {pattern!r}: {error}", "a regular expression", "correct it") from None
    if match is None or not match.groups():
        raise FormatError(
            f"{where}: {pattern!r} finds nothing in {text!r}",
            "a pattern with one group, as in ([A-Za-z]+) or x([-0-9.]+)",
            "correct pattern",
        )
    return match[1]


def _number(text: str, where: str) -> float:
    # "1p5" and "1,5" are how file names write 1.5.
    digits = re.findall(r"[-+]?\d+(?:[.,p]\d+)?", text)
    if len(digits) != 1:
        raise FormatError(
            f"{where}: {text!r} in the path holds {len(digits)} numbers",
            "one number",
            "say which by pattern: a regular expression with one group",
        )
    return float(digits[0].replace("p", ".").replace(",", "."))
