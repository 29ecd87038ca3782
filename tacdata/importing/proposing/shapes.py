"""Shapes of columns over time: a drive, a reading, or no signal at all."""

import re
from dataclasses import dataclass

import numpy as np

from tacdata.importing.source_table import SourceTable


@dataclass(frozen=True)
class ShapePolicy:
    """Limits of shapes. None was tuned on data."""

    rows: int = 50
    """Fewest rows by which a shape is judged [rows]."""
    smoother: float = 3.0
    """Smallest ratio of the roughness of every other column to that of a drive [1]."""
    follows: float = 0.7
    """Smallest correlation of a drive with the readings [1]."""
    exact: float = 1e-6
    """Roughness of numbers without noise [range]; smaller ones are rounding."""
    counts: float = 0.9
    """Smallest share of equal steps in a counter of rows [1]."""
    parts: float = 0.02
    """Largest share of steps of 1 in a counter of cycles or parts [1]."""
    returns: float = 0.3
    """Largest distance of a drive's last value from its first [its range]."""


POLICY = ShapePolicy()
NUMBER = re.compile(r"\d+")


def are_letters(names: list[str]) -> bool:
    """Return whether names are letters of the alphabet in their order, as of a sheet without a header."""
    return len(names) > 2 and names == [chr(ord(names[0][:1] or "?") + k) for k in range(len(names))]


def varying(table: SourceTable, names: list[str]) -> int:
    """Return how many of some columns change, those inside arrays counted each."""
    columns = [table.column(name) for name in names]
    numbers = [np.atleast_2d(values.astype(float).T) for values in columns if values.dtype != object]
    return sum(int((np.nanmax(each, axis=1) > np.nanmin(each, axis=1)).sum()) for each in numbers if each.size)


def without_signal(
    table: SourceTable, names: list[str], policy: ShapePolicy = POLICY, *, forced: bool = False
) -> dict[str, str]:
    """Return columns that measure nothing, each with the reason: constants, flags and counters of rows.

    A constant among columns of one name and different numbers is a dead channel, and stays. If all are idle, they stay,
    unless a force is read in addition (``forced``).
    """
    reasons = {name: _reason(table, name, policy) for name in names} if table.rows >= policy.rows else {}
    families: dict[str, list[str]] = {}
    for name in reasons:
        families.setdefault(NUMBER.sub("#", name), []).append(name)
    alive = {name for family in families.values() if not all(reasons[member] for member in family) for name in family}
    idle = {name: reason for name, reason in reasons.items() if reason and name not in alive}
    # Numbered ones alone are a dead sensor; a counter next to a load cell is none.
    is_sensor = len(idle) == len(names) and (not forced or max(map(len, families.values()), default=2) > 1)
    return {} if is_sensor else idle


def _reason(table: SourceTable, name: str, policy: ShapePolicy) -> str:
    values = table.column(name)
    if values.dtype == object or values.ndim > 1:
        return ""
    finite = values[np.isfinite(values.astype(float))]
    levels = np.unique(finite)
    if len(levels) < 2:
        return "constant"
    if len(levels) == 2 and np.isin(levels, (0, 1)).all():
        return "a flag"
    steps, is_whole = np.diff(finite), (finite == np.rint(finite)).all()
    usual = np.median(steps)
    if is_whole and usual > 0 and (steps == usual).mean() >= policy.counts:
        return "a counter of rows"
    is_count = is_whole and np.isin(steps, (0, 1)).all()
    return "a counter of parts" if is_count and steps.mean() <= policy.parts else ""


def counting_column(table: SourceTable, roles: dict[str, list[str]], policy: ShapePolicy = POLICY) -> str:
    """Return a column that counts the rows of a device and shows by a gap or a restart where some are lost; else ""."""
    for name in (*roles.get("counter", []), *roles.get("idle", [])):
        values = table.column(name)
        steps = np.diff(values.astype(float)) if values.dtype != object and values.ndim == 1 else np.empty(0)
        if len(steps) and policy.counts <= (steps == 1).mean() < 1:
            return name
    return ""


def drive_by_shape(table: SourceTable, names: list[str], policy: ShapePolicy = POLICY) -> str:
    """Return the column whose shape is that of a position: smooth, back at its start, followed by the readings.

    Returns:
        Its name, or "" if there is none, or more than one.
    """
    columns = {name: table.column(name) for name in names}
    series = {name: values.astype(float) for name, values in columns.items() if values.ndim == 1}
    series = {name: values for name, values in series.items() if np.isfinite(values).all() and np.ptp(values) > 0}
    if table.rows < policy.rows or len(series) < 2:
        return ""
    roughness = {name: max(_roughness(values), policy.exact) for name, values in series.items()}
    name, second = sorted(roughness, key=lambda column: roughness[column])[:2]
    if roughness[second] <= policy.smoother * roughness[name]:
        return ""
    values = series.pop(name)
    if abs(values[-1] - values[0]) > policy.returns * np.ptp(values):
        return ""
    way = np.abs(values - values[0])
    changes = [np.abs(reading - np.median(reading[:5])) / np.ptp(reading) for reading in series.values()]
    correlation = float(np.corrcoef(way, np.mean(changes, axis=0))[0, 1])
    return name if correlation >= policy.follows else ""


def _roughness(values: np.ndarray) -> float:
    """Return the mean size of second differences without the largest twentieth [range of the values]."""
    bends = np.sort(np.abs(np.diff(values, 2)))
    return float(bends[: max(int(0.95 * len(bends)), 1)].mean() / np.ptp(values))
