"""Cubics through a table on a grid, compiled: a place after the other, all its numbers together."""

from __future__ import annotations

import numpy as np
import warp as wp  # noqa: TID253 - kernels; imported with a table's values, never with the response's module

import tacdata.warp_runtime  # noqa: F401 - starts Warp
from tacdata.chain.lanes import Lanes, in_lanes


@wp.func
def _spline(t: wp.float64):
    one, three, four, six = wp.float64(1.0), wp.float64(3.0), wp.float64(4.0), wp.float64(6.0)
    square, cube = t * t, t * t * t
    back = one - t
    return wp.vec4d(
        back * back * back / six, (three * cube - six * square + four) / six,
        (three * square - three * cube + three * t + one) / six, cube / six,
    )  # fmt: skip


@wp.func
def _lagrange(t: wp.float64):
    one, two, six = wp.float64(1.0), wp.float64(2.0), wp.float64(6.0)
    back, on, far = t + one, t - one, t - two
    return wp.vec4d(-t * on * far / six, back * on * far / two, -back * t * far / two, back * t * on / six)


@wp.func
def _weights(t: wp.float64, through_nodes: bool):
    if through_nodes:
        return _lagrange(t)
    return _spline(t)


@wp.kernel(module="unique", enable_backward=False)
def _cubic(
    place: wp.array2d(dtype=wp.float64), table: wp.array2d(dtype=Lanes), wide: int, deep: int, through_nodes: bool,
    result: wp.array2d(dtype=Lanes),
):  # fmt: skip
    i = wp.tid()
    x, y, z = wp.floor(place[i, 0]), wp.floor(place[i, 1]), wp.floor(place[i, 2])
    a, b = _weights(place[i, 0] - x, through_nodes), _weights(place[i, 1] - y, through_nodes)
    c = _weights(place[i, 2] - z, through_nodes)
    first = (int(x) * wide + int(y)) * deep + int(z)
    for j in range(table.shape[1]):
        total = Lanes()
        for p in range(4):
            for q in range(4):
                share, at = a[p] * b[q], first + (p * wide + q) * deep
                for r in range(4):
                    total += share * c[r] * table[at + r, j]
        result[i, j] = total


def cubic(table: np.ndarray, place: np.ndarray, through_nodes: bool, columns: int) -> np.ndarray:
    """Return a table's values at places, shape (n, columns).

    Args:
        table: Coefficients of cubic B-splines, or values at nodes; one node more before and two after those that places
            may lie at, shape (a, b, d, lanes), a multiple of `LANES`, float64.
        place: Places [nodes of the smaller grid], shape (n, 3), float64.
        through_nodes: Whether the table holds values, read by the cubics through four of them.
        columns: How many of the lanes hold something.
    """
    _, wide, deep, lanes = table.shape
    result = np.empty((len(place), lanes))
    if len(place):
        there = wp.array(np.ascontiguousarray(place), dtype=wp.float64, device="cpu", copy=False)
        given = [there, in_lanes(table.reshape(-1, lanes)), wide, deep, through_nodes, in_lanes(result)]
        wp.launch(_cubic, len(place), given, device="cpu")
    return result[:, :columns]
