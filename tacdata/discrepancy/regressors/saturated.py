"""Saturated models: all that a family of effects might do, whatever its law, as columns.

A family's library has laws with few numbers. Its saturated model has their common structure, with many: gains
that change over the session and over the sensor, depths by place and order, readings that hang behind by any time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Course, Prediction, Response, predict
from tacdata.chain.memory import low_pass, play, running_max
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.regressors.generic import TIME_CONSTANTS, depth_slope
from tacdata.discrepancy.regressors.stack import side_by_side
from tacdata.effects import Family, Placed

WAVES = 6
"""Half waves over a session: a change within a sixth of it is seen."""
GAIN_WAVES = 4
"""The same for gains, which differ over the sensor, too."""
STEPS = (1 / 3, 1 / 2, 2 / 3)
"""Shares of a session after which something may have jumped [1]."""
LAGS = (0.2, 0.6, 2.0)
"""Time constants with which a tip may yield sideways [s]."""
WIDTHS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Widths of play [largest depth, or rise]."""
LATE = (0.01, 0.03, 0.1)
"""Time constants of a filter [s]."""
SIDE = 3.0
"""Steepness of a change from one side of the bed to the other [half widths]."""
LATERAL = 0.05
"""Lateral displacement of the finite difference, a plausible error of place [mm]."""
FEW, MANY = 0.5, 2.0
"""Numbers of earlier presses over which softening of a place decays [1]."""


@dataclass(frozen=True)
class _Ways:
    """Input of columns: changes of streams, and the histories of each row."""

    course: Course
    streams: Streams
    rise: np.ndarray
    """Rise under presses, shape (m, streams)."""
    slope: np.ndarray
    """Change of every stream with a tenth of the stroke, shape (m, streams)."""
    full: np.ndarray
    """Rise of each channel under presses in every row, shape (n, channels)."""
    share: np.ndarray
    """Depth, over the largest [1], shape (n,)."""
    leaving: np.ndarray
    """Direction of a tip that touches: 1 down, -1 up [1], shape (n,)."""
    clock: np.ndarray
    """Share of the session that is over [1], shape (n,)."""

    def of_channels(self, values: np.ndarray) -> np.ndarray:
        """Return values of channels, shape (n, channels), as a column; other streams do not change."""
        column = np.zeros_like(self.rise)
        column[:, : values.shape[1]] = values[self.streams.rows]
        return column

    def times(self, history: np.ndarray) -> list[np.ndarray]:
        """Return gain and depth, each times a history, shape (n,)."""
        row = history[self.streams.rows][:, None]
        return [self.rise * row, self.slope * row]


def saturated(course: Course, response: Response, placed: list[Placed]) -> dict[Family, np.ndarray]:
    """Return the columns of each family that has a saturated model, each of shape (m, streams, k), float32.

    Args:
        course: The recordings.
        response: Input of the chain.
        placed: Effects that the model has.
    """
    streams, prediction = Streams.of(course), predict(course, response, placed)
    ways = _ways(course, streams, response, prediction, placed)
    result = {
        Family.DRIFT: _drift(ways),
        Family.KINEMATICS: _pose(ways, response, placed),
        Family.SKIN_MEMORY: _memory(ways),
        Family.FRICTION_AND_PLAY: _friction(ways),
        Family.DELAY_AND_FILTER: _late(ways),
    }
    if not response.fitted:  # a fitted one takes these up
        result |= {Family.RESPONSE_CURVE: _curve(ways), Family.CROSSTALK: _spread(ways)}
    return {family: side_by_side(columns) for family, columns in result.items() if columns}


def _ways(course: Course, streams: Streams, response: Response, prediction: Prediction, placed: list[Placed]) -> _Ways:
    depth = np.maximum(course.tip[:, 2], 0.0)
    if depth.max() <= 0:
        depth = course.tip[:, 2] - course.tip[:, 2].min()
    return _Ways(
        course,
        streams,
        streams.rise(prediction, response),
        depth_slope(course, response, placed) * (0.1 * course.stroke),
        prediction.signal - response.signal(np.zeros((1, course.channels))),
        depth / max(float(depth.max()), 1e-9),
        np.sign(course.speed) * (depth > 0),
        course.time / max(float(course.time[-1]), 1e-9),
    )


def _waves(ways: _Ways, count: int) -> list[np.ndarray]:
    return [np.cos(np.pi * k * ways.clock) for k in range(1, count + 1)]


def _drift(ways: _Ways) -> list[np.ndarray]:
    """Gains that change over the session, or with temperature, by a smooth map of the sensor."""
    course, histories = ways.course, _waves(ways, GAIN_WAVES)
    if course.temperature is not None:
        warm = (course.temperature - course.temperature.mean()) / max(float(np.std(course.temperature)), 1e-9)
        histories += [warm, warm**2 - 1]
    maps = _maps(course)
    return [ways.of_channels(ways.full * history[:, None] * weight) for weight in maps for history in histories]


def _maps(course: Course) -> list[np.ndarray]:
    """Return weights of the channels that change smoothly over the sensor: those of a plane and a saddle."""
    if course.centers is None:
        return [np.ones(course.channels)]
    at = course.centers - course.centers.mean(axis=0)
    x, y = (at / max(float(np.abs(at).max()), 1e-9)).T
    maps = [x, y, x * y, x * x - np.mean(x * x), y * y - np.mean(y * y)]
    return [np.ones(course.channels), *(weights for weights in maps if np.abs(weights).max() > 1e-6)]


def _pose(ways: _Ways, response: Response, placed: list[Placed]) -> list[np.ndarray]:
    """A tip that is elsewhere by place, side, order or direction, at once or late."""
    course, rows = ways.course, ways.streams.rows
    places, orders = _places(course), [*_waves(ways, WAVES), *(np.sign(ways.clock - at) for at in STEPS)]
    touching = (ways.share > 0).astype(float)
    within = [np.ones(course.rows), ways.leaving, *(low_pass(touching, course.step, tau) - touching for tau in LAGS)]
    histories = [place * factor for place in places for factor in within]
    histories += [*orders, *(order * ways.leaving for order in orders[:2])]
    columns = [ways.slope * history[rows][:, None] for history in histories]
    if response.fitted:  # differences between places are its own, and it knows no sides
        return columns
    aside = [*places, *(place * ways.leaving for place in places[:3]), *orders[:3]]
    for axis in (0, 1):
        change = _moved(ways, response, placed, axis)
        columns += [change * history[rows][:, None] for history in aside]
    return columns


def _places(course: Course) -> list[np.ndarray]:
    """Return functions of the pressed place: a plane, a saddle, and one side against the other."""
    at = course.tip[:, :2] - np.median(course.tip[:, :2], axis=0)
    x, y = (at / np.maximum(np.abs(at).max(axis=0), 1e-6)).T
    each = [np.ones(course.rows), x, y, x * x, x * y, y * y, np.tanh(SIDE * x), np.tanh(SIDE * y)]
    return [shape for shape in each if np.abs(shape).max() > 1e-6]


def _moved(ways: _Ways, response: Response, placed: list[Placed], axis: int) -> np.ndarray:
    """Return the change of every stream with a tip that is aside, shape (m, streams)."""
    course, by = ways.course, np.zeros(3)
    by[axis] = LATERAL
    forward, backward = (predict(replace(course, tip=course.tip + sign * by), response, placed) for sign in (1, -1))
    change = 0.5 * (ways.streams.predicted(forward) - ways.streams.predicted(backward))
    if ways.streams.tag:
        change[:, -3:] = 0.0
    return change


def _memory(ways: _Ways) -> list[np.ndarray]:
    """Readings that follow by any time, harder or later in the session; a skin that differs once it was pressed."""
    columns: list[np.ndarray] = []
    for tau in TIME_CONSTANTS:
        # Linear memory that fades is close to a sum of exponentials.
        difference = low_pass(ways.full, ways.course.step, tau) - ways.full
        by = (np.ones(ways.course.rows), ways.share, ways.clock - 0.5)
        columns += [ways.of_channels(difference * factor[:, None]) for factor in by]
    course, deepest = ways.course, running_max(ways.share, ways.course.row_site)
    presses = _earlier(course)[course.episode]
    fresh = np.exp(-presses / MANY)
    # Skin that was pressed as deep before is softer there, and only there.
    met = (ways.share < deepest - 1e-3).astype(float)
    for history in (deepest - ways.share, fresh, fresh * ways.share, np.exp(-presses / FEW), met):
        columns += ways.times(history)
    return columns


def _earlier(course: Course) -> np.ndarray:
    """Return how many presses each place has seen before each, shape (episodes,)."""
    count: dict[int, int] = {}
    result = np.zeros(course.episodes)
    for episode, site in enumerate(course.site.tolist()):
        result[episode] = count.get(site, 0)
        count[site] = count.get(site, 0) + 1
    return result


def _friction(ways: _Ways) -> list[np.ndarray]:
    """Loading against unloading, by any width of play, whatever the rate."""
    columns: list[np.ndarray] = []
    top = np.abs(ways.full).max(axis=0)
    # Sums of play operators follow nearly any hysteresis that is independent of rate (Prandtl and Ishlinskii).
    for width in WIDTHS:
        each = [play(reading, width * scale) - reading for reading, scale in zip(ways.full.T, top, strict=True)]
        columns.append(ways.of_channels(np.stack(each, axis=1)))
        columns.append(ways.times((play(ways.share, width) - ways.share) / 0.1)[1])
    near = np.exp(-np.square(ways.share / 0.1)) * (ways.leaving < 0)
    for history in (ways.leaving, ways.leaving * ways.share, ways.leaving * ways.share**2, near):
        columns += ways.times(history)
    return columns


def _late(ways: _Ways) -> list[np.ndarray]:
    """Readings that depend on the rate, and filters."""
    speed = ways.course.speed / max(float(np.abs(ways.course.speed).max()), 1e-9)
    columns: list[np.ndarray] = []
    for history in (speed, speed * ways.share, np.abs(speed), np.abs(speed) * speed):
        columns += ways.times(history)
    differences: Iterable[np.ndarray] = (low_pass(ways.full, ways.course.step, tau) - ways.full for tau in LATE)
    return [*columns, *(ways.of_channels(difference) for difference in differences)]


def _curve(ways: _Ways) -> list[np.ndarray]:
    """Readings that grow by another law of depth."""
    columns: list[np.ndarray] = []
    for power in (0.5, 1.0, 2.0, 3.0):
        columns += ways.times(ways.share**power)
    return columns


def _spread(ways: _Ways) -> list[np.ndarray]:
    """Readings of other channels: those next to each, and all."""
    course, full = ways.course, ways.full
    mixed = [np.broadcast_to(full.mean(axis=1, keepdims=True), full.shape)]
    if course.centers is not None:
        far = np.linalg.norm(course.centers[:, None] - course.centers[None], axis=2)
        nearest = np.min(far + np.where(far > 0, 0.0, np.inf), axis=1, keepdims=True)
        mixed.append(full @ ((far > 0) & (far <= 1.2 * nearest)).T)
    mixed += [np.roll(full, by, axis=1) for by in (1, -1)]
    return [
        ways.of_channels(neighbour * by[:, None]) for neighbour in mixed for by in (np.ones(course.rows), ways.share)
    ]
