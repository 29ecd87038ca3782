"""Columns of one residual's shape, laid side by side."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

BLOCK_BYTES = 2**19
"""Laid out at once: so much of all columns stays in a processor's cache."""


def side_by_side(columns: Iterable[np.ndarray]) -> np.ndarray:
    """Return columns as one array, shape (n, streams, k), float32, as `numpy.stack` would along the last axis.

    Args:
        columns: Each of shape (n, streams).
    """
    parts = list(columns)
    rows, streams = parts[0].shape
    result = np.empty((rows, streams, len(parts)), dtype=np.float32)
    step = max(BLOCK_BYTES // max(result[:1].nbytes, 1), 1)
    for begin in range(0, rows, step):
        block = result[begin : begin + step]
        for k, column in enumerate(parts):
            block[:, :, k] = column[begin : begin + step]
    return result


def apart(values: np.ndarray) -> list[np.ndarray]:
    """Return the columns of an array (n, streams, k), each of shape (n, streams)."""
    return list(np.moveaxis(values, 2, 0))
