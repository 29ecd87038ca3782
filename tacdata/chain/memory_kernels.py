# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Recursions along rows, compiled: row after row, all columns of a row together."""

from __future__ import annotations

import numpy as np
import warp as wp  # noqa: TID253 - kernels; imported when a history is run, never with an effect

import tacdata.warp_runtime  # noqa: F401 - starts Warp


@wp.kernel(module="unique", enable_backward=False)
def _filter(
    values: wp.array2d(dtype=wp.float64), decay: wp.array(dtype=wp.float64), weight: wp.array(dtype=wp.float64),
    result: wp.array2d(dtype=wp.float64),
):  # fmt: skip
    for i in range(1, values.shape[0]):
        fade, now, before = decay[i], wp.float64(1.0) - weight[i], weight[i] - decay[i]
        for j in range(values.shape[1]):
            result[i, j] = fade * result[i - 1, j] + now * values[i, j] + before * values[i - 1, j]


@wp.kernel(module="unique", enable_backward=False)
def _play(
    values: wp.array2d(dtype=wp.float64), width: wp.float64, anew: wp.array(dtype=wp.int8),
    result: wp.array2d(dtype=wp.float64),
):  # fmt: skip
    for j in range(values.shape[1]):
        result[0, j] = values[0, j] - width
    for i in range(1, values.shape[0]):
        for j in range(values.shape[1]):
            u = values[i, j]
            if anew[i] > wp.int8(0):
                result[i, j] = u - width
            else:
                result[i, j] = wp.max(u - width, wp.min(u + width, result[i - 1, j]))


def filtered(values: np.ndarray, decay: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return y_i = E_i y_{i-1} + (1 - w_i) u_i + (w_i - E_i) u_{i-1} with y_0 = 0, shape (n, k).

    Args:
        values: u, shape (n, k), float64.
        decay: E, shape (n,), float64.
        weight: w, shape (n,), float64.
    """
    result = np.zeros(values.shape)
    if len(values):
        wp.launch(_filter, 1, [_shared(values), _shared(decay), _shared(weight), _shared(result)], device="cpu")
    return result


def played(values: np.ndarray, width: float, anew: np.ndarray) -> np.ndarray:
    """Return y_i = max(u_i - w, min(u_i + w, y_{i-1})), u_i - w at first and anew, shape (n, k), as u (float64).

    Args:
        values: u, shape (n, k), float64.
        width: w, in the input's unit.
        anew: Rows that forget those before, shape (n,), bool.
    """
    result = np.zeros(values.shape)
    if len(values):
        forgets = wp.array(np.ascontiguousarray(anew, dtype=np.int8), dtype=wp.int8, device="cpu", copy=False)
        wp.launch(_play, 1, [_shared(values), wp.float64(width), forgets, _shared(result)], device="cpu")
    return result


def _shared(values: np.ndarray) -> wp.array:
    """Return an array of Warp's that uses the same memory."""
    return wp.array(np.ascontiguousarray(values), dtype=wp.float64, device="cpu", copy=False)
