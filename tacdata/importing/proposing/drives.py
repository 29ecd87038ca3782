"""Substitutes for a missing depth or rate, and columns that separate strokes instead of trials."""

from itertools import pairwise

import numpy as np

from tacdata.importing.pressing.press_path import strokes
from tacdata.importing.pressing.presses import DEEPEST
from tacdata.importing.proposing.strokes import CLEAR
from tacdata.importing.source_table import SourceTable
from tacdata.importing.units import plain

MEANT = ("strain", "angle", "force")
"""Roles that may replace a depth, best first."""
ONE_WAY, WIDE, APART, STILL = 0.8, 0.5, 0.2, 0.1
"""Half a stroke ends this share of its range from its beginning, and spans this share of the whole. The next one
begins at its end, to within this share. A part that spans less than the last share is a hold."""
ALIKE = 0.9
"""Share of the steps in which two lengths move equally, from which one is a copy of the other."""
RATES = tuple(step * 10.0**power for power in (-1, 0, 1, 2) for step in (1, 2, 5))[:10]
"""Rates that are guessed where no column is a time [1/s]."""
LASTS = 2.0
"""A press takes about so long [s]."""


def stand_in(tables: dict[str, SourceTable], roles: dict[str, dict[str, list[str]]]) -> str:
    """Use another drive in place of a missing depth; return the question that this raises, or "".

    A hinge drives a sensor as a stage does. So does a hand over a load cell.
    """
    if any({"depth", "z"} & set(entry) for entry in roles.values()):
        return ""
    for role in MEANT:
        moving = [(alias, name) for alias, entry in roles.items() for name in entry.get(role, [])]
        moving = [(alias, name) for alias, name in moving if _levels(tables[alias], name) > 2]
        channels = [name for entry in roles.values() for name in entry["channels"]]
        if not moving or not channels:
            continue
        alias, name = max(moving, key=lambda pair: _levels(tables[pair[0]], pair[1]))
        roles[alias]["depth"] = roles[alias]["stand_in"] = [name]
        for entry in roles.values():
            entry.pop(role, None)
        unit = plain(tables[alias].units.get(name, "")) or "of its units"
        distance = f"{1000 if length_of(tables[alias], name) == 'um' else 1} {unit}"
        return (
            f"no column is a position or a depth: {name} stands for one, {distance} as 1 mm. So a verdict says how "
            f"readings follow it, and its mm are {distance}"
        )
    return ""


def length_of(table: SourceTable, name: str) -> str:
    """Return the unit of a column used as a depth: um where no press is so deep."""
    return "um" if float(np.nanmax(np.abs(table.column(name).astype(float)))) > DEEPEST else "mm"


def rate_of(table: SourceTable, columns: dict[str, list[str]]) -> float:
    """Return a rate by which a press takes some seconds."""
    if table.rate:
        return table.rate
    rows = [float(table.rows)]
    moving = columns.get("depth") or columns.get("z")
    if "trial" in columns:
        _, rows = np.unique(table.column(columns["trial"][0]).astype(str), return_counts=True)
    elif moving and (axis := table.column(moving[0])).dtype != object:
        way = np.abs(axis.astype(float) - axis[0])[np.isfinite(axis.astype(float))]
        rows = [table.rows / max(strokes(way, CLEAR * float(way.max(initial=0.0))), 1)]
    return min(RATES, key=lambda rate: abs(np.log(rate * LASTS / float(np.median(rows)))))


def _levels(table: SourceTable, name: str) -> int:
    """Return how many values a column takes."""
    values = table.column(name)
    return 0 if values.dtype == object or values.ndim > 1 else len(np.unique(values[np.isfinite(values)]))


def are_halves(labels: np.ndarray, axis: np.ndarray) -> bool:
    """Return whether labels part strokes into halves, as "1-Stretch" and "1-Recover" do, with holds or without.

    Args:
        labels: The column's value in each row, shape (rows,).
        axis: The moving axis, shape (rows,).
    """
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), len(labels)]
    runs = [axis[a:b][np.isfinite(axis[a:b])] for a, b in pairwise(edges)]
    extent = float(np.nanmax(axis) - np.nanmin(axis))
    runs = [run for run in runs if len(run) > 2 and np.ptp(run) > STILL * extent]
    if len(runs) < 4 or extent <= 0:
        return False
    net = np.array([run[-1] - run[0] for run in runs])
    spans = np.array([np.ptp(run) for run in runs])
    half = (np.abs(net) > ONE_WAY * spans) & (spans > WIDE * extent)
    joined = np.abs([b[0] - a[-1] for a, b in pairwise(runs)]) < APART * extent
    turns = net[1:] * net[:-1] < 0
    return bool(half.mean() > ALIKE - 0.1 and joined.mean() > ALIKE - 0.1 and turns.mean() > ALIKE - 0.1)


def is_copy(table: SourceTable, first: str, second: str) -> bool:
    """Return whether one length is the other from another zero."""
    a, b = (np.diff(table.column(name).astype(float)) for name in (first, second))
    moving = np.isfinite(a + b) & ((a != 0) | (b != 0))
    if not moving.any():
        return True
    return bool((np.abs(a - b)[moving] <= 1e-6 * np.abs(a[moving]).max() + 1e-12).mean() > ALIKE)
