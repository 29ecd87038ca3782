"""Residuals of a verdict as curves over the time of the sessions, the stream with most to see first."""

import numpy as np

from tacdata.discrepancy.verdict.residual_table import Residuals
from tacdata.viewers.scene.scene import Curves
from tacdata.viewers.scene.thinning import extremes

ROWS = 4000
"""Rows of a stream that are drawn, about [1]."""
MOST = 32
"""Streams that are drawn; of more, those with most to see [1]."""
READINGS, RESIDUALS = "readings", "residuals"


def residual_curves(residuals: Residuals) -> tuple[Curves, ...]:
    """Return for each stream its readings measured, before and after, and the residual over the noise; then the depth.

    Args:
        residuals: Document of `tacdata discrepancy`.
    """
    time_ns = np.round(residuals.time * 1e9).astype(np.int64)
    breaks = np.flatnonzero(np.diff(residuals.episode)) + 1
    power = np.nanmean(np.square(residuals.standardized(residuals.before)), axis=0)
    curves = []
    for k in np.argsort(-np.nan_to_num(power))[:MOST].tolist():
        name = residuals.streams[k].replace(" ", "_")
        readings = np.column_stack([residuals.measured[:, k], residuals.before[:, k], residuals.after[:, k]])
        remainder = (readings[:, :1] - readings[:, 1:]) / residuals.noise[k]
        curves.append(
            _curves(f"{READINGS}/{name}", "as recorded", ("measured", "before", "after"), time_ns, readings, breaks)
        )
        curves.append(_curves(f"{RESIDUALS}/{name}", "noise", ("before", "after"), time_ns, remainder, breaks))
    depth = _curves("depth", "mm", ("commanded",), time_ns, residuals.depth[:, None], breaks)
    return (*curves, depth)


def _curves(
    name: str, unit: str, labels: tuple[str, ...], time_ns: np.ndarray, values: np.ndarray, breaks: np.ndarray
) -> Curves:
    """Return curves of few enough rows that do not run on from one episode into the next."""
    rows = extremes(values, ROWS)
    cut = np.unique(np.searchsorted(rows, breaks))
    cut = cut[(cut > 0) & (cut < len(rows))]
    # A row of NaN breaks the line between the last row of an episode and the first of the next.
    between = (time_ns[rows[cut - 1]] + 1).astype(np.int64)
    time_ns, values = np.insert(time_ns[rows], cut, between), np.insert(values[rows], cut, np.nan, axis=0)
    return Curves(name, unit, labels, time_ns, values)
