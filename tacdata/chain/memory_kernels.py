"""Recursions along rows, compiled: row after row, all columns together."""

from __future__ import annotations

import numpy as np

from tacdata.chain.lanes import Lanes, in_lanes, padded
from tacdata.warp_runtime import wp  # noqa: TID253 - kernels; imported when a history is run, never with an effect


@wp.kernel(module="unique", enable_backward=False)
def _filter(
    values: wp.array2d(dtype=Lanes),
    decay: wp.array2d(dtype=wp.float64),
    weight: wp.array2d(dtype=wp.float64),
    share: wp.array(dtype=wp.float64),
    state: wp.array2d(dtype=Lanes),
    result: wp.array2d(dtype=Lanes),
):
    for i in range(1, values.shape[0]):
        for j in range(values.shape[1]):
            value, previous, total = values[i, j], values[i - 1, j], Lanes()
            for t in range(share.shape[0]):
                fade, gain = decay[i, t], weight[i, t]
                y = fade * state[t, j] + (wp.float64(1.0) - gain) * value + (gain - fade) * previous
                state[t, j] = y
                total += share[t] * y
            result[i, j] = total


@wp.kernel(module="unique", enable_backward=False)
def _play(
    values: wp.array2d(dtype=wp.float64),
    width: wp.float64,
    anew: wp.array(dtype=wp.int8),
    result: wp.array2d(dtype=wp.float64),
):
    for j in range(values.shape[1]):
        result[0, j] = values[0, j] - width
    for i in range(1, values.shape[0]):
        for j in range(values.shape[1]):
            u = values[i, j]
            if anew[i] > wp.int8(0):
                result[i, j] = u - width
            else:
                result[i, j] = wp.max(u - width, wp.min(u + width, result[i - 1, j]))


@wp.func
def _rest(below: wp.float64, way: wp.float64, power: wp.float64):
    """Return y at the end of a way by dy/du = -y^p, y first ``below``."""
    q = wp.float64(1.0) - power
    if wp.abs(q) < wp.float64(1e-6):
        return below * wp.exp(-way)
    return wp.pow(wp.max(wp.pow(below, q) - q * way, wp.float64(0.0)), wp.float64(1.0) / q)


@wp.kernel(module="unique", enable_backward=False)
def _slip(
    values: wp.array(dtype=wp.float64),
    gap: wp.float64,
    power: wp.float64,
    start: wp.array(dtype=wp.float64),
    result: wp.array(dtype=wp.float64),
):
    none, one = wp.float64(0.0), wp.float64(1.0)
    turn, crossed = wp.float64(0.0), wp.float64(0.0)
    for i in range(values.shape[0]):
        if i == 0 or not wp.isnan(start[i]):
            turn = wp.float64(start[i])
            crossed = wp.float64(0.5) * (one + turn) * gap
        else:
            way = values[i] - values[i - 1]
            sign = wp.where(way < none, -one, one)
            left, below = wp.abs(way), one - sign * turn
            # The force of the other direction goes first, then the gap is crossed, then the force rises.
            if below > one:
                q = one - power
                fall = wp.log(below)
                if wp.abs(q) > wp.float64(1e-6):
                    fall = (wp.pow(below, q) - one) / q
                below = wp.where(left < fall, _rest(below, left, power), one)
                left = wp.max(left - fall, none)
            if left > none:
                free = wp.min(left, wp.where(sign > none, gap - crossed, crossed))
                crossed += sign * free
                below = _rest(below, left - free, power)
            turn = sign * (one - below)
        result[i] = turn


def filtered(values: np.ndarray, decay: np.ndarray, weight: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the sum of y_i = E_i y_{i-1} + (1 - w_i) u_i + (w_i - E_i) u_{i-1}, y_0 = 0, over filters, shape (n, k).

    Args:
        values: u, shape (n, k), float64.
        decay: E of each filter, shape (n, t), float64.
        weight: w of each, shape (n, t), float64.
        share: By which each is multiplied, shape (t,), float64.
    """
    columns, wide = values.shape[1], padded(values)
    result, state = np.empty(wide.shape), np.zeros((len(share), wide.shape[1]))
    if len(values):
        result[0] = 0.0
        arguments = [in_lanes(wide), _shared(decay), _shared(weight), _shared(share), in_lanes(state), in_lanes(result)]
        # One thread: each row needs the one before it, and columns are taken in lanes.
        wp.launch(_filter, 1, arguments, device="cpu")
    return np.ascontiguousarray(result[:, :columns])


def played(values: np.ndarray, width: float, anew: np.ndarray) -> np.ndarray:
    """Return y_i = max(u_i - w, min(u_i + w, y_{i-1})), u_i - w at a reset, shape (n, k), as u (float64).

    Args:
        values: u, shape (n, k), float64.
        width: w, in the input's unit.
        anew: Rows of a reset, shape (n,), bool.
    """
    result = np.zeros(values.shape)
    if len(values):
        forgets = wp.array(np.ascontiguousarray(anew, dtype=np.int8), dtype=wp.int8, device="cpu", copy=False)
        wp.launch(_play, 1, [_shared(values), wp.float64(width), forgets, _shared(result)], device="cpu")
    return result


def slipped(values: np.ndarray, gap: float, power: float, start: np.ndarray) -> np.ndarray:
    """Return z, -1 to 1, of a friction behind a gap, shape (n,).

    Args:
        values: u over the way of the turn, shape (n,), float64.
        gap: Over that way.
        power: p of dz/du = |1 - z sgn u'|^p, 0 or more.
        start: z where it is set, NaN at all other rows, shape (n,), float64; the first row's is.
    """
    result = np.empty(len(values))
    if len(values):
        arguments = [_shared(values), wp.float64(gap), wp.float64(power), _shared(start), _shared(result)]
        wp.launch(_slip, 1, arguments, device="cpu")
    return result


def _shared(values: np.ndarray) -> wp.array:
    """Return an array of Warp's that uses the same memory."""
    return wp.array(np.ascontiguousarray(values), dtype=wp.float64, device="cpu", copy=False)
