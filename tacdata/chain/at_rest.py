"""Readings without contact: whether they tell a gain of whole readings from offsets and from a gain above idle."""

from __future__ import annotations

import numpy as np

from tacdata.chain.course import Course

UNLIKE = 0.5
"""A gain is told from drifting offsets where readings differ by so much, over their mean [1]."""
AT_REST = 0.05
"""It is told from a gain above idle where readings without contact are so large [largest rise]."""


def quiet_rows(course: Course) -> np.ndarray:
    """Return rows where nothing presses, shape (n,), bool."""
    return course.tip[:, 2] <= max(0.0, float(course.tip[:, 2].min()) + 0.05 * course.stroke)


def told_at_rest(course: Course) -> tuple[np.ndarray | None, str]:
    """Return each channel's reading without contact, shape (channels,), or None and why it tells no gain.

    Args:
        course: The recordings; those with the rows read alone will do.
    """
    course = course.reduced if len(course.read) < course.rows else course
    known = np.isfinite(course.readings).all(axis=1)
    quiet = known & quiet_rows(course)
    if not quiet.any():
        return None, "nothing was read without contact"
    values, idle = course.readings[known], np.median(course.readings[quiet], axis=0)
    if np.abs(idle).max() < AT_REST * np.abs(values - idle).max():
        return None, "readings without contact are about zero"
    if np.std(values) < UNLIKE * abs(float(np.mean(values))):
        return None, "all readings are about alike: offsets that drift look the same"
    return idle, ""
