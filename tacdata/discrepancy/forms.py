"""What an effect's equation may be off about: its own contribution, a little larger here and smaller there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.streams import Streams
from tacdata.effects import Placed


def forms(course: Course, response: Response, placed: Sequence[Placed], given: Sequence[Placed] = ()) -> np.ndarray:
    """Return columns at one standard deviation, shape (n, streams, k), float32; k is 0 without placed effects.

    A large effect whose equation is a little wrong leaves what small effects explain: what lies along these columns is
    no evidence of another one.
    """
    streams, every = Streams.of(course), list(given)
    columns = []
    whole = streams.predicted(predict(course, response, [*every, *placed])) if placed else None
    for at in range(len(placed)):
        rest = [p for k, p in enumerate(placed) if k != at]
        own = whole - streams.predicted(predict(course, response, [*every, *rest]))
        off = placed[at].effect.form_error
        columns += [off * own * by for by in modulations(course, streams, own)]
    if not columns:
        return np.zeros((len(course.read), streams.count, 0), dtype=np.float32)
    return np.stack(columns, axis=-1).astype(np.float32)


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
