"""The residual by depth, phase and rate."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.verdict.residual_table import Residuals

FEWEST = 30
"""Readings of a field of the map, at least."""
STILL = "hold"
AT_TOUCH = 0.005
"""A depth of less is where the tip touches [deepest]."""


@dataclass(frozen=True)
class HeatMap:
    """Mean squares of a model's residual, over the noise."""

    rows: tuple[str, ...]
    """Phases, each at a slow and a fast rate where it moves."""
    columns: tuple[str, ...]
    """Depths."""
    before: np.ndarray
    """Of the model as it was [1], shape (rows, columns); NaN where too little was read."""


def heat_map(residuals: Residuals) -> HeatMap:
    """Return the map of all presses, an offset a press taken off."""
    each = np.nanmean(np.square(residuals.standardized(residuals.before)), axis=1)
    inside = residuals.phase > 0
    edges = np.quantile(residuals.depth[inside], [0, 1 / 3, 2 / 3, 1]).round(6) if inside.any() else np.zeros(4)
    edge_labels = [f"{edge:.2g}" if edge >= AT_TOUCH * edges[-1] else "0" for edge in edges]
    columns = tuple(f"{low} to {high} mm" for low, high in itertools.pairwise(edge_labels))
    within = [(residuals.depth >= low) & (residuals.depth <= high) for low, high in itertools.pairwise(edges)]
    rate = np.abs(residuals.rate)
    rows, fields = [], []
    for k, phase in enumerate(residuals.phases):
        if not k:
            continue
        phase_rows = residuals.phase == k
        if phase == STILL or not phase_rows.any():
            rows.append(phase)
            fields.append(phase_rows)
            continue
        middle = float(np.median(rate[phase_rows]))
        for name, part in (("slow", phase_rows & (rate <= middle)), ("fast", phase_rows & (rate > middle))):
            rows.append(f"{phase}, {name}")
            fields.append(part)
    squares = np.array([[_mean(each, row & column) for column in within] for row in fields])
    read = np.flatnonzero(np.isfinite(squares).any(axis=1))
    return HeatMap(tuple(rows[k] for k in read), columns, squares[read])


def _mean(each: np.ndarray, rows: np.ndarray) -> float:
    return float(np.nanmean(each[rows])) if rows.sum() >= FEWEST else float("nan")
