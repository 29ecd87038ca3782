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
    course: Course, response: Response, placed: Sequence[Placed], model_effects: Sequence[Placed] = ()
) -> ModelErrors:
    """Return the regressors; no columns without placed effects.

    A large effect whose equation is a little wrong leaves a residual that small effects explain: a part along these
    columns is no evidence of another one.
    """
    streams, fixed = Streams.of(course), list(model_effects)
    none = np.zeros((len(course.read), streams.count, 0), dtype=np.float32)
    if not placed:
        return ModelErrors(none, np.zeros(0, dtype=np.int64), none)
    columns: list[np.ndarray] = []
    of, parts = [], []
    for at, member in enumerate(placed):
        background = [*fixed, *(p for k, p in enumerate(placed) if k != at)]
        chain = Chain(course, response, background)
        bare = streams.predicted(chain.prediction)
        contribution = streams.predicted(chain.again([*background, member])) - bare
        # An equation errs by a share of its effect, along anything that the effect may depend on.
        columns += [member.effect.form_error * contribution * by for by in modulations(course, streams, contribution)]
        size = float(np.linalg.norm(contribution))
        for variant in variants(member, course.channels):
            if variant.effect.name != member.effect.name and variant.effect.unjudgeable(course, response):
                continue
            change = streams.predicted(chain.again([*background, variant])) - bare
            large = float(np.linalg.norm(change))
            if large > NEGLIGIBLE * size:
                # Scaled to the effect itself, as `form_error` is a share of it.
                columns.append(OTHER_FORMS * member.effect.form_error * size / large * change)
        parts.append(contribution)
        of += [at] * (len(columns) - len(of))
    return ModelErrors(
        np.stack(columns, axis=-1).astype(np.float32), np.array(of), np.stack(parts, axis=-1).astype(np.float32)
    )


def variants(reference: Placed, channels: int) -> list[Placed]:
    """Return a mechanism in its other forms and shapes: no polymer relaxes with one time constant.

    Args:
        reference: An effect with its numbers.
        channels: How many channels there are.
    """
    result = []
    for effect in library():
        if effect.called != reference.effect.called:
            continue
        if not effect.shapes and effect.name == reference.effect.name:
            result += [_sized(reference, by) for by in OTHER_SIZES if effect.distributed]
            continue
        sizes = [
            {
                p.name: np.full(
                    channels if p.per_channel else (), p.default + p.typical * (p is parameter), dtype=float
                )
                for p in effect.amplitudes
            }
            for parameter in effect.amplitudes
        ]
        grid = list(product(*(p.grid for p in effect.shapes)))
        if effect.name == reference.effect.name:
            current = [float(reference.values[p.name]) for p in effect.shapes]
            neighbours = [(k, by * value) for k, value in enumerate(current) for by in OTHER_SHAPES]
            grid += [(*current[:k], value, *current[k + 1 :]) for k, value in neighbours]
        for shapes in grid:
            shape_values = {
                p.name: np.clip(value, p.low, p.high) for p, value in zip(effect.shapes, shapes, strict=True)
            }
            result += [Placed(effect, size_values | shape_values) for size_values in sizes]
    return result


def _sized(reference: Placed, by: float) -> Placed:
    """Return an effect of another size, within its bounds."""
    return Placed(
        reference.effect,
        {
            p.name: np.clip(p.default + by * (reference.values[p.name] - p.default), p.low, p.high)
            for p in reference.effect.parameters
        },
    )


def modulations(course: Course, streams: Streams, contribution: np.ndarray) -> list[np.ndarray]:
    """Return how a contribution, shape (n, streams), may differ: with depth, rate, direction, time and its own size.

    Each has a mean of 0 and a root mean square of 1, weighted by the square of the contribution; shape (n, 1) or that
    of the contribution.
    """
    depth = np.clip(course.tip[:, 2] / max(float(course.tip[:, 2].max()), 1e-9), 0.0, 1.0)
    speed = np.abs(course.speed) / max(float(np.abs(course.speed).max()), 1e-9)
    clock = course.time / max(float(course.time[-1]), 1e-9)
    rows = [h[streams.rows][:, None] for h in (depth, speed, np.sign(course.speed), clock)]
    size = np.linalg.norm(contribution, axis=1, keepdims=True)
    weight = np.square(size)
    total = max(float(weight.sum()), 1e-30)
    result = []
    for row in (*rows, size):
        # Without its weighted mean: a factor of the whole contribution is fitted anyhow.
        deviation = row - float((row * weight).sum()) / total
        spread = float(np.sqrt((np.square(deviation) * weight).sum() / total))
        result.append(deviation / spread if spread > 1e-9 else np.zeros_like(deviation))
    return result
