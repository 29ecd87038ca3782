"""Operators with memory along a course: what effects of history are built from."""

from __future__ import annotations

import numpy as np

_SPAN = 30.0
"""Longest stretch handled at once, in time constants: exp(30) loses no digits that matter."""


def low_pass(values: np.ndarray, step: np.ndarray, tau: float) -> np.ndarray:
    """Return the solution of tau y' + y = u for u linear between rows, from rest.

    Exact for piecewise linear input: y_i = E y_{i-1} + (1 - w) u_i + (w - E) u_{i-1}, E = exp(-dt/tau),
    w = (1 - E) tau / dt.

    Args:
        values: Input, shape (n,) or (n, k).
        step: Time since the row before [s], shape (n,).
        tau: Time constant [s], above 0.
    """
    flat = values[:, None] if values.ndim == 1 else values
    ratio = step / tau
    decay = np.exp(-np.minimum(ratio, 700.0))
    weight = np.where(ratio > 1e-8, -np.expm1(-np.minimum(ratio, 700.0)) / np.maximum(ratio, 1e-12), 1.0)
    source = (1 - weight)[:, None] * flat
    source[1:] += (weight - decay)[1:, None] * flat[:-1]
    source[0] = 0.0
    result = scan(source, ratio)
    return result[:, 0] if values.ndim == 1 else result


def scan(source: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Return y_i = exp(-ratio_i) y_{i-1} + source_i, shape (n, k)."""
    n, result = len(source), np.empty_like(source)
    ratio = np.minimum(ratio, _SPAN)
    passed = np.cumsum(ratio)
    begin, carry = 0, np.zeros(source.shape[1])
    while begin < n:
        before = passed[begin] - ratio[begin]
        end = max(int(np.searchsorted(passed, before + 2 * _SPAN)), begin + 1)
        grown = np.exp(passed[begin:end] - before)
        result[begin:end] = (np.cumsum(source[begin:end] * grown[:, None], axis=0) + carry) / grown[:, None]
        carry = result[end - 1]
        begin = end
    return result


def play(values: np.ndarray, width: float) -> np.ndarray:
    """Return the play operator: what follows an input through a dead band of +- ``width``, shape as the input.

    y_i = max(u_i - w, min(u_i + w, y_{i-1})); before the first row the input came from below.

    Args:
        values: Input, shape (n,) or (n, k).
        width: Half the dead band, in the input's unit.
    """
    if values.ndim == 2:
        # Row by row for all columns at once.
        low, high = values - width, values + width
        result, last = np.empty_like(low), low[0]
        for below, above, out in zip(low, high, result, strict=True):
            np.minimum(above, last, out=out)
            last = np.maximum(below, out, out=out)
        return result
    result = np.empty(len(values))
    last = float(values[0]) - width
    for i, u in enumerate(values.tolist()):
        if last < u - width:
            last = u - width
        elif last > u + width:
            last = u + width
        result[i] = last
    return result


def running_max(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return the largest value so far within each group of rows (a place, for example), shape (n,)."""
    result = np.empty(len(values))
    for key in np.unique(group):
        rows = group == key
        result[rows] = np.maximum.accumulate(values[rows])
    return result


def delayed(values: np.ndarray, time: np.ndarray, episode: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """Return values as they were ``delay`` before each row, linear between rows, never across episodes.

    Args:
        values: Shape (n, k).
        time: Time of each row [s], shape (n,).
        episode: Episode of each row, shape (n,).
        delay: How long before [s], shape (n,); negative for later.
    """
    wanted = time - delay
    starts = np.searchsorted(episode, np.arange(episode[-1] + 1))
    ends = np.append(starts[1:], len(time))
    low, high = starts[episode], ends[episode] - 1
    wanted = np.clip(wanted, time[low], time[high])
    right = np.clip(np.searchsorted(time, wanted), low + 1, high)
    right = np.maximum(right, 1)
    gap = np.maximum(time[right] - time[right - 1], 1e-12)
    share = np.clip((wanted - time[right - 1]) / gap, 0.0, 1.0)[:, None]
    return (1 - share) * values[right - 1] + share * values[right]
