"""Clocks of streams that share a table: each column has the clock before it."""

import numpy as np

from tacdata.importing.mapping import Axis, PositionEntry, SourceClock
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.source_table import SourceTable
from tacdata.importing.units import plain

SHORT = ("s", "ms", "us", "ns", "min", "h", "d")
"""Units of time that a mapping may name; others stand in the header and are read from there."""
STEADY = 0.9
"""Smallest share of steps in which a clock rises [1]."""


def clock_by(table: SourceTable, name: str) -> SourceClock:
    """Return the clock of a column, with the unit of its header."""
    unit = plain(table.units.get(name, ""))
    return SourceClock(column=name, unit=unit if unit in SHORT else "")


def own_clocks(kind: SourceKind, position: PositionEntry) -> tuple[str, str] | None:
    """Return the clock columns before the position and before the channels of one file; None if they share one."""
    places, channels = list(kind.table.columns), kind.channels
    clocks = [name for name in kind.roles.get("time", []) if _rises(kind.table, name)]
    axis = position.axes.get("depth") or position.axes.get("z")
    name = axis.column if isinstance(axis, Axis) else ""
    if len(clocks) < 2 or name not in places or not channels or channels[0] not in places:
        return None

    present = {column: ~_missing(kind.table, column) for column in (*clocks, name, channels[0])}

    def before(name: str | int) -> str:
        """Return the only clock with values in the rows of a column, else the last before it or the first behind."""
        together = [clock for clock in clocks if np.array_equal(present[clock], present[str(name)])]
        if len(together) == 1:
            return together[0]
        nearer = [clock for clock in clocks if places.index(clock) < places.index(str(name))]
        return nearer[-1] if nearer else clocks[0]

    ours, theirs = before(name), before(channels[0])
    return None if ours == theirs else (ours, theirs)


def _missing(table: SourceTable, name: str | int) -> np.ndarray:
    """Return which rows of a column have no value, shape (rows,), bool."""
    values = table.column(str(name))
    values = values.reshape(len(values), -1)[:, 0]
    return np.array([value is None for value in values]) if values.dtype == object else np.isnan(values.astype(float))


def _rises(table: SourceTable, name: str) -> bool:
    """Return whether a column of numbers rises, as a clock does."""
    values = table.column(name)
    if values.dtype == object:
        return False
    steps = np.diff(values.astype(float))
    return bool((steps[np.isfinite(steps)] > 0).mean() > STEADY) if len(steps) else False
