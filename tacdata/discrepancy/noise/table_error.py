"""How far a table of solved presses is off: waves over depth, in part common to all presses.

A mesh touches an indenter node by node. So the error goes up and down with depth. It differs from place to place. It is
the same down and up, at any rate. The prior is a Gaussian process over depth, as a cosine series.
"""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course

MODES = 16
"""Cosine series: the shortest wave is an eighth of the deepest press [1]."""
COMMON = 0.25
"""Share of the error common to all presses (`benchmarks/settled_studies.md`) [1]."""
REPEATED = 2.0
"""By how much more it counts: presses of one place do not average it [1]."""


def modes(error: float, rise: np.ndarray, scale: np.ndarray, course: Course) -> np.ndarray | None:
    """Return the modes of each press and stream [noise scales], shape (m, modes). Without an error there are none.

    A mode is the change by one standard deviation.

    Args:
        error: Root mean square error of the table's loads, over that of the loads [1].
        rise: Readings above those without load [each stream's unit], shape (m, streams).
        scale: Standard deviation of the noise [the same], shape (streams,).
        course: With the rows read alone.
    """
    if error <= 0.0:
        return None
    channels = course.channels
    level = np.sqrt(np.mean(np.square(rise[:, :channels] / scale[:channels]), axis=1))
    return (REPEATED * error * level[:, None] * _waves(course)).astype(np.float32)


def common(error: float, rise: np.ndarray, course: Course) -> np.ndarray:
    """Return the modes that all presses share, shape (m, streams, modes).

    A mode is the change by one standard deviation.

    Args:
        error: Root mean square error of the table's loads, over that of the loads [1]; 0 for no modes.
        rise: Readings above those without load [each stream's unit], shape (m, streams).
        course: With the rows read alone.
    """
    waves = _waves(course)[:, : MODES if error > 0.0 else 0]
    return (COMMON * error * rise[:, :, None] * waves[:, None, :]).astype(np.float32)


def _waves(course: Course) -> np.ndarray:
    """Return cosines over depth, with a mean square of 1 all together, shape (m, modes)."""
    share = np.clip(course.tip[:, 2] / max(float(course.tip[:, 2].max()), 1e-9), 0.0, 1.0)
    return np.cos(np.pi * np.arange(MODES) * share[:, None]) * np.sqrt(2.0 / MODES)
