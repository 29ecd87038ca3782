"""Place and tool of every row: each pair has a fitted response of its own."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course


def contexts(course: Course) -> np.ndarray:
    """Return the place-and-tool of every row, numbered from 0, shape (n,), int64."""
    key = course.row_site * (int(course.tool.max()) + 1) + course.tool
    return np.unique(key, return_inverse=True)[1].astype(np.int64)
