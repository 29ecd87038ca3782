"""Generic columns, of no effect: patterns times histories of the path. Is anything left to explain?"""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.chain.course import NUDGE
from tacdata.chain.memory import low_pass, play, running_max
from tacdata.discrepancy.data.streams import Streams
from tacdata.effects import Placed

CLOCK_HISTORIES = (3, 4, -1)
"""Histories that follow the clock: a drift of the electronics does, too."""
TIME_CONSTANTS = (0.1, 0.4, 1.5, 6.0, 25.0, 100.0)
"""Time constants of leaky means of depth [s]."""


def generic(course: Course, response: Response, placed: list[Placed]) -> np.ndarray:
    """Return columns, shape (n, streams, k), float32: patterns of the streams times histories of the path."""
    streams, predicted = Streams.of(course), predict(course, response, placed)
    rise = streams.rise(predicted, response)
    slope = depth_slope(course, response, placed)
    level = np.zeros_like(rise)
    level[:, : course.channels] = response.largest(predicted.signal[streams.rows])
    # Clock histories are left to `slow`: offsets and drift would make this test fire at any session.
    path_histories = np.delete(histories(course), CLOCK_HISTORIES, axis=1)[streams.rows]
    parts = [rise[:, :, None] * path_histories[:, None, :], slope[:, :, None] * path_histories[:, None, :] * 0.1]
    parts.append(level[:, :, None] * path_histories[:, None, ::2])
    return np.concatenate(parts, axis=2, dtype=np.float32)


def slow(course: Course, response: Response, placed: list[Placed]) -> np.ndarray:
    """Return columns of changes over a session, shape (n, streams, k), float32: gains and depths with the clock.

    They separate slow changes from differences between visits of a place; they are no evidence themselves.
    """
    streams = Streams.of(course)
    rise = streams.rise(predict(course, response, placed), response)
    clock_histories = [histories(course)[:, k] for k in CLOCK_HISTORIES]
    if course.temperature is not None:
        clock_histories.append(
            (course.temperature - course.temperature.mean()) / max(float(np.std(course.temperature)), 1e-9)
        )
    follow = np.stack(clock_histories, axis=-1)[streams.rows][:, None, :]
    slope = depth_slope(course, response, placed)[:, :, None] * (0.1 * course.stroke)
    return np.concatenate([rise[:, :, None] * follow, slope * follow], axis=2, dtype=np.float32)


def histories(course: Course) -> np.ndarray:
    """Return the histories of a path, each of size about 1, shape (n, k)."""
    share = depth_share(course)
    speed = course.speed
    fast = np.abs(speed) / max(float(np.abs(speed).max()), 1e-9)
    clock = course.time / max(float(course.time[-1]), 1e-9) - 0.5
    deepest = running_max(share, course.row_site)
    stroke = _since_start(course, share)
    # Clock columns have mean 0 (that of its square is 1/12): an offset is fitted anyhow.
    columns = [
        np.sign(speed),
        np.sign(speed) * fast,
        fast,
        clock,
        clock**2 - 1 / 12,
        deepest - share,
        stroke - share,
        deepest - stroke,
        *(low_pass(share, course.step, tau) for tau in TIME_CONSTANTS),
        *(np.square(low_pass(share, course.step, tau)) for tau in TIME_CONSTANTS[1::2]),
        *(play(share, r) - share for r in (0.03, 0.1, 0.3)),
        share * (speed < 0),
        np.exp(-np.square(share / 0.1)) * (speed < 0),
        course.session[course.episode] - float(np.mean(course.session)),
    ]
    return np.stack(columns, axis=-1)


def depth_share(course: Course) -> np.ndarray:
    """Return the depth over the deepest of all [1], shape (n,); heights are taken where nothing is below the face."""
    depth = np.maximum(course.tip[:, 2], 0.0)
    if depth.max() <= 0:
        depth = course.tip[:, 2] - course.tip[:, 2].min()
    return depth / max(float(depth.max()), 1e-9)


def depth_slope(course: Course, response: Response, placed: list[Placed]) -> np.ndarray:
    """Return the change of every stream with depth [1/mm], shape (n, streams); 0 for the tag's."""
    streams, (deeper, higher) = Streams.of(course), course.nudged
    change = streams.predicted(predict(deeper, response, placed)) - streams.predicted(predict(higher, response, placed))
    if streams.tag:
        change[:, -3:] = 0.0
    return change / (2 * NUDGE * course.stroke)


def _since_start(course: Course, values: np.ndarray) -> np.ndarray:
    """Return the largest value so far in each episode, shape (n,)."""
    return running_max(values, course.episode)
