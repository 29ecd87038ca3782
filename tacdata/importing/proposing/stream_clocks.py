"""Clocks of streams that share a table: each column has the clock before it."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.importing.source_table import SourceTable
from tacdata.importing.units import plain

SHORT = ("s", "ms", "us", "ns", "min", "h", "d")
"""Units of time that a mapping may name; others stand in the header and are read from there."""
STEADY = 0.9
"""Smallest share of steps in which a clock rises [1]."""


def own_clocks(
    document: dict[str, Any], tables: dict[str, SourceTable], roles: dict[str, dict[str, list[str]]], notes: list[str]
) -> None:
    """Give a position the clock column before it if the channels of the same file follow another clock column."""
    position, alias = document.get("position", {}), document["taxels"]["file"]
    if position.get("file") != alias or not roles[alias]["channels"]:
        return
    table = tables[alias]
    clocks = [name for name in roles[alias].get("time", []) if _rises(table, name)]
    axis = position.get("depth") or position.get("z") or {}
    places = list(table.columns)
    if len(clocks) < 2 or axis.get("column") not in places or roles[alias]["channels"][0] not in places:
        return

    def before(name: str) -> str:
        """Return the last clock before a column, else the first one behind it."""
        nearer = [clock for clock in clocks if places.index(clock) < places.index(name)]
        return nearer[-1] if nearer else clocks[0]

    ours, theirs = before(axis["column"]), before(roles[alias]["channels"][0])
    if ours == theirs:
        return
    for name, entry in ((ours, position), (theirs, document["taxels"])):
        unit = plain(table.units.get(name, ""))
        entry["time"] = {"column": name, **({"unit": unit} if unit in SHORT else {})}
    notes.append(f"{theirs} is taken for the clock of the channels, and {ours} for the one of the position")


def _rises(table: SourceTable, name: str) -> bool:
    """Return whether a column of numbers rises, as a clock does."""
    values = table.column(name)
    if values.dtype == object:
        return False
    steps = np.diff(values.astype(float))
    return bool((steps[np.isfinite(steps)] > 0).mean() > STEADY) if len(steps) else False
