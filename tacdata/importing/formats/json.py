"""JSON: columns by name, rows by name, or rows alone; JSON Lines with a row a line."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.npz import WHOLE, rows_of, stacked
from tacdata.importing.formats.source_format import SourceFormat
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable
from tacdata.importing.text.stated_rate import stated_rate

LINES = (".jsonl", ".ndjson")
BROKEN = 0.01
"""Largest share of lines that are no JSON and are left out [1]."""
MOST_FIELDS = 4096
"""A longer list holds rows, and no description of fields."""
FEWEST = 10
"""Fewer rows are settings, and no recording."""


class Json(SourceFormat):
    """Lists as columns; a list of objects or of lists as rows. Objects inside objects become ``outer.inner``."""

    endings = (".json", *LINES)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the lists that have rows. See the base."""
        text = path.read_text(encoding="utf-8-sig")
        by_line = path.suffix.lower() in LINES
        doubts: list[str] = []
        content = _by_line(path, text, doubts) if by_line else _by_name(json.loads(text))
        arrays = {name: _array(values) for name, values in _lists(content, doubts).items()}
        table = rows_of(path, arrays, options)
        if table.rows < FEWEST:
            raise FormatError(
                f"{path} holds no {FEWEST} rows: settings, as it seems",
                "lists of as many values, or rows",
                "leave it out, or save what was recorded as a table",
            )
        stated = _units(content)
        units = {name: unit for name in table.columns if (unit := stated.get(name.rpartition(".")[2]))}
        settings = [f"{name}: {value}" for name, value in _flat({"": content}).items() if not isinstance(value, list)]
        rate = stated_rate("\n".join([*settings, ""]), len(settings))
        return replace(table, units={**units, **table.units}, doubts=tuple(doubts), rate=rate)


def _by_name(content: Any) -> Any:
    """Return a list of rows next to a list of their columns, as pandas splits a table, as columns by name."""
    names, rows = (content.get(key) for key in ("columns", "data")) if isinstance(content, dict) else (None, None)
    if not (isinstance(names, list) and isinstance(rows, list)) or not all(isinstance(row, list) for row in rows):
        return content
    # Without one value for each column the two lists only look like a table.
    if len({str(name) for name in names}) < len(names) or {len(row) for row in rows} != {len(names)}:
        return content
    return {str(name): list(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)}


def _by_line(path: Path, text: str, doubts: list[str]) -> list[Any]:
    """Return the value of each line. Few lines that are cut off are left out and counted in ``doubts``."""
    rows, broken = [], []
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        try:
            rows += [json.loads(line)] if line.strip() else []
        except json.JSONDecodeError:
            broken.append(number)
    # One cut line is usual: the logger was switched off.
    if len(broken) > max(BROKEN * len(lines), 1):
        raise FormatError(
            f"{path}: {len(broken)} of {len(lines)} lines are no JSON, first line {broken[0]} "
            f"({lines[broken[0] - 1][:40]})",
            "a value a line",
            "correct a copy, and import the copy",
        )
    if broken:
        cut = f"{len(broken)} line{'s are' if len(broken) > 1 else ' is'} cut off or no JSON"
        doubts.append(f"{path.name}: {cut}, first line {broken[0]}: left out")
    return rows


def _units(value: Any) -> dict[str, str]:
    """Return the units of fields by name that a schema in the file states, as of a table with a schema."""
    if isinstance(value, dict):
        name, unit = value.get("name"), value.get("unit") or value.get("units")
        if isinstance(name, str) and isinstance(unit, str):
            return {name: unit}
        block = _flat(unit) if isinstance(unit, dict) else {}  # {"units": {"t": "ms", "depth": "um"}}
        stated = {key.rpartition(".")[2]: each for key, each in block.items() if isinstance(each, str)}
        return stated | {name: unit for part in value.values() for name, unit in _units(part).items()}
    if isinstance(value, list) and len(value) < MOST_FIELDS:
        return {name: unit for part in value for name, unit in _units(part).items()}
    return {}


def _lists(value: Any, doubts: list[str], name: str = "") -> dict[str, Any]:
    """Return the lists in a value by name, and what is left out in ``doubts``."""
    if isinstance(value, dict):
        parts = [_flat(part) for part in value.values() if isinstance(part, dict)]
        if len(parts) == len(value) > 1 and _trials(parts):  # {"trial_1": {...}, "trial_2": {...}}
            return _lists(parts, doubts, name)
        inside = [_lists(part, doubts, f"{name}.{key}" if name else str(key)) for key, part in value.items()]
        return {key: values for part in inside for key, values in part.items()}
    if not isinstance(value, list) or not value:
        return {}
    if not any(isinstance(row, dict) for row in value):
        return {name or WHOLE: value}
    rows = [_flat(row) if isinstance(row, dict) else {} for row in value]
    if trials := _trials(rows):
        lost: list[str] = []
        columns = stacked(name, trials, lost)
        doubts += [f"left out: {', '.join(lost)}"] * bool(lost)
        return columns
    names = dict.fromkeys(key for row in rows for key in row)
    return {f"{name}.{key}" if name else key: [row.get(key) for row in rows] for key in names}


def _trials(rows: list[dict[str, Any]]) -> list[dict[str, np.ndarray]]:
    """Return the columns of each trial if each row holds several long lists; [] if a row is a sample."""
    lengths = [[len(value) for value in row.values() if isinstance(value, list)] for row in rows]
    longest = max(len(rows), FEWEST - 1)
    if not all(each and each.count(max(each)) > 1 and max(each) > longest for each in lengths):
        return []
    return [
        {key: _array(value) if isinstance(value, list) else np.array(value) for key, value in row.items()}
        for row in rows
    ]


def _flat(row: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of an object with those of objects inside it."""
    fields: dict[str, Any] = {}
    for key, value in row.items():
        fields |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return fields


def _array(values: list[Any]) -> np.ndarray:
    """Return a list as numbers, NaN for null, or as text; lists of one length inside it as a table."""
    # A null in place of a list is a row without readings, not a table of another shape.
    widths = {len(row) if isinstance(row, list) else -1 for row in values if row is not None}
    if len(widths) == 1 and (width := widths.pop()) > 0:
        values = [[None] * width if row is None else row for row in values]
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        return np.array([None if value is None else str(value) for value in values], dtype=object)
