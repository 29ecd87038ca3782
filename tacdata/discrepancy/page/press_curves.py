"""Curves of the sealed presses that the effects change most: measured, model before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.verdict.residual_table import Residuals

MOST_PRESSES = 24
"""Presses that are shown."""


@dataclass(frozen=True)
class PressCurves:
    """One press on the channel of its largest change."""

    name: str
    stream: str
    time: np.ndarray
    """Since its first reading [s], shape (n,)."""
    depth: np.ndarray
    """[mm], shape (n,)."""
    measured: np.ndarray
    """[the stream's unit], shape (n,)."""
    before: np.ndarray
    """Model as it was given [the stream's unit], shape (n,)."""
    after: np.ndarray
    """Model with the effects [the stream's unit], shape (n,)."""
    noise: float
    """Standard deviation of the stream's noise [its unit]."""


def largest_changes(residuals: Residuals, count: int = MOST_PRESSES) -> list[PressCurves]:
    """Return the sealed presses in which the effects change most; of all presses, where none was sealed.

    They show where the effects matter, whether they help there or not.
    """
    change = np.square((residuals.after - residuals.before) / residuals.noise.astype(np.float32))
    square = np.square(residuals.standardized(residuals.before))
    among = residuals.sealed or tuple(int(k) for k in np.unique(residuals.episode))
    measure = change if np.nanmax(change, initial=0.0) > 0 else square
    ranked = []
    for k in among:
        rows = residuals.episode == k
        if rows.sum() < 3:
            continue
        each = np.nanmean(measure[rows], axis=0)
        stream = int(np.nanargmax(each)) if np.isfinite(each).any() else 0
        ranked.append((float(np.nan_to_num(each[stream])), k, stream))
    return [_press(residuals, k, stream) for _, k, stream in sorted(ranked, key=lambda one: -one[0])[:count]]


def _press(residuals: Residuals, number: int, stream: int) -> PressCurves:
    rows = residuals.episode == number
    time = residuals.time[rows]
    return PressCurves(
        residuals.names[number],
        residuals.streams[stream],
        time - time[0],
        residuals.depth[rows],
        residuals.measured[rows, stream],
        residuals.before[rows, stream],
        residuals.after[rows, stream],
        float(residuals.noise[stream]),
    )
