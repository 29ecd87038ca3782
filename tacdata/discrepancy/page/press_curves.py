"""Curves of the sealed presses that the effects change most: measured, model before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.report.residual_table import Residuals

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


def largest_changes(found: Residuals, most: int = MOST_PRESSES) -> list[PressCurves]:
    """Return the sealed presses in which the effects change most; of all presses, where none was sealed.

    They show where the effects matter, whether they help there or not.
    """
    change = np.square((found.after - found.before) / found.noise.astype(np.float32))
    square = np.square(found.standardized(found.before))
    among = found.sealed or tuple(int(k) for k in np.unique(found.episode))
    measure = change if np.nanmax(change, initial=0.0) > 0 else square
    ranked = []
    for k in among:
        rows = found.episode == k
        if rows.sum() < 3:
            continue
        each = np.nanmean(measure[rows], axis=0)
        stream = int(np.nanargmax(each)) if np.isfinite(each).any() else 0
        ranked.append((float(np.nan_to_num(each[stream])), k, stream))
    return [_press(found, k, stream) for _, k, stream in sorted(ranked, key=lambda one: -one[0])[:most]]


def _press(found: Residuals, number: int, stream: int) -> PressCurves:
    rows = found.episode == number
    time = found.time[rows]
    return PressCurves(
        found.names[number],
        found.streams[stream],
        time - time[0],
        found.depth[rows],
        found.measured[rows, stream],
        found.before[rows, stream],
        found.after[rows, stream],
        float(found.noise[stream]),
    )
