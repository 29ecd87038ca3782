"""Cubics through a table on a grid, compiled: a place after the other, all its numbers together."""

from __future__ import annotations

import numpy as np

from tacdata.chain.lanes import Lanes, in_lanes
from tacdata.warp_runtime import wp  # noqa: TID253 - kernels; imported with a table's values, never with the response's module

SAVED = 2.0
"""Depths are read from a table of each place where those have fewer nodes than so many times the rows [1]."""


@wp.func
def _spline(t: wp.float64):
    one, three, four, six = wp.float64(1.0), wp.float64(3.0), wp.float64(4.0), wp.float64(6.0)
    square, cube = t * t, t * t * t
    back = one - t
    return wp.vec4d(
        back * back * back / six,
        (three * cube - six * square + four) / six,
        (three * square - three * cube + three * t + one) / six,
        cube / six,
    )


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
    place: wp.array2d(dtype=wp.float64),
    table: wp.array2d(dtype=Lanes),
    wide: int,
    deep: int,
    through_nodes: bool,
    result: wp.array2d(dtype=Lanes),
):
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


@wp.kernel(module="unique", enable_backward=False)
def _at_places(
    place: wp.array2d(dtype=wp.float64),
    table: wp.array2d(dtype=Lanes),
    wide: int,
    deep: int,
    through_nodes: bool,
    result: wp.array2d(dtype=Lanes),
):
    i = wp.tid()
    x, y = wp.floor(place[i, 0]), wp.floor(place[i, 1])
    a, b = _weights(place[i, 0] - x, through_nodes), _weights(place[i, 1] - y, through_nodes)
    first = (int(x) * wide + int(y)) * deep
    for r in range(deep):
        for j in range(table.shape[1]):
            total = Lanes()
            for p in range(4):
                for q in range(4):
                    total += a[p] * b[q] * table[first + (p * wide + q) * deep + r, j]
            result[i * deep + r, j] = total


@wp.kernel(module="unique", enable_backward=False)
def _along_depth(
    depth: wp.array(dtype=wp.float64),
    run: wp.array(dtype=wp.int32),
    table: wp.array2d(dtype=Lanes),
    deep: int,
    through_nodes: bool,
    result: wp.array2d(dtype=Lanes),
):
    i = wp.tid()
    z = wp.floor(depth[i])
    c = _weights(depth[i] - z, through_nodes)
    first = run[i] * deep + int(z)
    for j in range(table.shape[1]):
        total = Lanes()
        for r in range(4):
            total += c[r] * table[first + r, j]
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
    if not len(place):
        return result[:, :columns]
    nodes, moves = in_lanes(table.reshape(-1, lanes)), np.any(place[1:, :2] != place[:-1, :2], axis=1)
    begins = np.concatenate([[0], np.flatnonzero(moves) + 1])
    if len(begins) * deep > len(place) * SAVED:
        wp.launch(
            _cubic, len(place), [_shared(place), nodes, wide, deep, through_nodes, in_lanes(result)], device="cpu"
        )
        return result[:, :columns]
    # A press goes down and up at one place: 16 of the 64 nodes' weights are the same all along.
    nodes_between = in_lanes(np.empty((len(begins) * deep, lanes)))
    arguments = [_shared(place[begins]), nodes, wide, deep, through_nodes, nodes_between]
    wp.launch(_at_places, len(begins), arguments, device="cpu")
    run = np.zeros(len(place), dtype=np.int32)
    run[1:] = np.cumsum(moves)
    runs = wp.array(run, dtype=wp.int32, device="cpu", copy=False)
    arguments = [_shared(place[:, 2]), runs, nodes_between, deep, through_nodes, in_lanes(result)]
    wp.launch(_along_depth, len(place), arguments, device="cpu")
    return result[:, :columns]


def _shared(values: np.ndarray) -> wp.array:
    """Return an array of Warp's that uses the same memory, where rows lie one after the other."""
    return wp.array(np.ascontiguousarray(values), dtype=wp.float64, device="cpu", copy=False)
