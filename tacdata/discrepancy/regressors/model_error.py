"""Model error: error of an effect's equation, as regressors with a prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from tacdata.chain import Chain, Course, Response
from tacdata.discrepancy.data.streams import Streams
from tacdata.effects import Placed, library

OTHER_FORMS = 3.0
"""Prior of a mechanism's other forms and shapes, over that of its equation [1]."""
OTHER_SIZES = (0.25, 0.5, 2.0, 4.0)
"""Other sizes of an effect without a shape: its time constant or width is its size [1]."""
OTHER_SHAPES = (0.5, 2.0)
"""Factors of an effect's own shape: periods have harmonics, relaxation a spectrum [1]."""
NEGLIGIBLE = 1e-9
"""A form that changes less than this share of the effect is left out [1]."""


@dataclass(frozen=True)
class ModelErrors:
    """Errors of the equations of placed effects."""

    values: np.ndarray
    """Columns at one standard deviation [each stream's unit], shape (n, streams, k), float32."""
    at: np.ndarray
    """Which placed effect each is of, shape (k,), int64."""
    parts: np.ndarray
    """Contribution of each placed effect to all others [each stream's unit], shape (n, streams, placed), float32."""


def model_errors(
    course: Course, response: Response, placed: Sequence[Placed], given: Sequence[Placed] = ()
) -> ModelErrors:
    """Return the regressors; no columns without placed effects.

    A large effect whose equation is a little wrong leaves a residual that small effects explain: a part along these
    columns is no evidence of another one.
    """
    streams, every = Streams.of(course), list(given)
    none = np.zeros((len(course.read), streams.count, 0), dtype=np.float32)
    if not placed:
        return ModelErrors(none, np.zeros(0, dtype=np.int64), none)
    columns: list[np.ndarray] = []
    of, parts = [], []
    for at, one in enumerate(placed):
        rest = [*every, *(p for k, p in enumerate(placed) if k != at)]
        chain = Chain(course, response, rest)
        bare = streams.predicted(chain.prediction)
        own = streams.predicted(chain.again([*rest, one])) - bare
        columns += [one.effect.form_error * own * by for by in modulations(course, streams, own)]
        size = float(np.linalg.norm(own))
        for other in variants(one, course.channels):
            if other.effect.name != one.effect.name and other.effect.unjudgeable(course, response):
                continue
            change = streams.predicted(chain.again([*rest, other])) - bare
            large = float(np.linalg.norm(change))
            if large > NEGLIGIBLE * size:
                # Scaled to the effect itself, as `form_error` is a share of it.
                columns.append(OTHER_FORMS * one.effect.form_error * size / large * change)
        parts.append(own)
        of += [at] * (len(columns) - len(of))
    return ModelErrors(
        np.stack(columns, axis=-1).astype(np.float32), np.array(of), np.stack(parts, axis=-1).astype(np.float32)
    )


def variants(one: Placed, channels: int) -> list[Placed]:
    """Return a mechanism in its other forms and shapes: no polymer relaxes with one time constant.

    Args:
        one: An effect with its numbers.
        channels: How many channels there are.
    """
    made = []
    for effect in library():
        if effect.called != one.effect.called:
            continue
        if not effect.shapes and effect.name == one.effect.name:
            made += [_sized(one, by) for by in OTHER_SIZES if effect.distributed]
            continue
        sizes = [
            {
                p.name: np.full(channels if p.per_channel else (), p.default + p.typical * (p is own), dtype=float)
                for p in effect.amplitudes
            }
            for own in effect.amplitudes
        ]
        every = list(product(*(p.grid for p in effect.shapes)))
        if effect.name == one.effect.name:
            now = [float(one.values[p.name]) for p in effect.shapes]
            beside = [(k, by * value) for k, value in enumerate(now) for by in OTHER_SHAPES]
            every += [(*now[:k], value, *now[k + 1 :]) for k, value in beside]
        for shapes in every:
            own = {p.name: np.clip(value, p.low, p.high) for p, value in zip(effect.shapes, shapes, strict=True)}
            made += [Placed(effect, alone | own) for alone in sizes]
    return made


def _sized(one: Placed, by: float) -> Placed:
    """Return an effect of another size, within its bounds."""
    return Placed(
        one.effect,
        {
            p.name: np.clip(p.default + by * (one.values[p.name] - p.default), p.low, p.high)
            for p in one.effect.parameters
        },
    )


def modulations(course: Course, streams: Streams, own: np.ndarray) -> list[np.ndarray]:
    """Return how a contribution, shape (n, streams), may differ: with depth, rate, direction, time and its own size.

    Each has a mean of 0 and a root mean square of 1, weighted by the square of the contribution; shape (n, 1) or that
    of the contribution.
    """
    depth = np.clip(course.tip[:, 2] / max(float(course.tip[:, 2].max()), 1e-9), 0.0, 1.0)
    speed = np.abs(course.speed) / max(float(np.abs(course.speed).max()), 1e-9)
    clock = course.time / max(float(course.time[-1]), 1e-9)
    rows = [h[streams.rows][:, None] for h in (depth, speed, np.sign(course.speed), clock)]
    size = np.linalg.norm(own, axis=1, keepdims=True)
    weight = np.square(size)
    total = max(float(weight.sum()), 1e-30)
    result = []
    for row in (*rows, size):
        apart = row - float((row * weight).sum()) / total
        spread = float(np.sqrt((np.square(apart) * weight).sum() / total))
        result.append(apart / spread if spread > 1e-9 else np.zeros_like(apart))
    return result
