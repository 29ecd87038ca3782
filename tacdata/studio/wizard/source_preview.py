"""Files, their first rows and their columns, for the page."""

from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import Mapping
from tacdata.importing.proposing.shapes import without_signal
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.source_table import SourceTable
from tacdata.importing.times import NEVER, times
from tacdata.pages.plot import picked
from tacdata.studio.wizard.chosen_mapping import column_names
from tacdata.studio.wizard.evidence import evidence

FIRST, POINTS, MOST = 6, 240, 400
"""Rows, points of a column's plot, and columns of a file that are shown."""
DIGITS = 7
"""Significant digits: enough for a time in ms over an hour."""


def file_preview(kind: SourceKind, mapping: Mapping) -> dict[str, Any]:
    """Return a file's first rows and columns, each with its grounds and a course over time."""
    table, names = kind.table, column_names(kind.table)[:MOST]
    pick = picked(table.rows, POINTS)
    seconds = _seconds(table, kind, mapping)
    position = mapping.position if mapping.position and mapping.position.file == kind.alias else None
    pressing = [str(axis.column) for key, axis in position.columns.items() if key in ("z", "depth")] if position else []
    path = table.column(pressing[0]) if pressing and pressing[0] in names else None
    path = path.astype(float) if path is not None and path.dtype != object else None
    idle = without_signal(table, [name for name in names if table.column(name).dtype != object])
    return {
        "alias": kind.alias,
        "path": kind.kind.replace("::", ", "),
        "first": kind.found.path,
        "count": kind.found.count,
        "rows": table.rows,
        "notes": list(table.notes),
        "head": [[_cell(table.column(name)[row]) for name in names] for row in range(min(FIRST, table.rows))],
        "time": numbers(seconds[pick]),
        "columns": [
            {
                "name": name,
                "stated": table.units.get(name.rpartition("[")[0] if name not in table.columns else name, ""),
                "evidence": evidence(kind, name, path, idle),
                "values": _values(table.column(name), pick),
            }
            for name in names
        ],
    }


def numbers(values: np.ndarray) -> list[float | None]:
    """Return numbers for JSON: None where one is missing."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.astype(float)]


def _seconds(table: SourceTable, kind: SourceKind, mapping: Mapping) -> np.ndarray:
    """Return the time of each row since the first [s], or its number where no clock can be read, shape (rows,)."""
    entry = mapping.files.get(kind.alias)
    try:
        time_ns, _ = times(table, entry.clock, "") if entry and entry.clock else (np.empty(0), "")
    except (FormatError, KeyError):
        time_ns = np.empty(0)
    valid = time_ns != NEVER
    if len(time_ns) != table.rows or not valid.any():
        return np.arange(table.rows, dtype=float)
    return np.where(valid, (time_ns - time_ns[valid][0]) / 1e9, np.nan)


def _values(values: np.ndarray, pick: np.ndarray) -> list[float | None]:
    """Return the plotted values of a column; those of text are its different texts, counted."""
    if values.dtype == object:
        texts = [str(value) for value in values[pick].tolist()]
        places = {text: place for place, text in enumerate(dict.fromkeys(texts))}
        return [float(places[text]) for text in texts]
    return numbers(values[pick])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.9g}" if isinstance(value, float | np.floating) else str(value)
