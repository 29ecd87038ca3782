"""What an effect's equation may be off about: its own contribution, a little larger here and smaller there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Prediction, Response, predict
from tacdata.chain.memory import low_pass
from tacdata.discrepancy.streams import Streams
from tacdata.effects import Placed

TIMES = (0.02, 0.05, 0.1, 0.4, 1.5, 6.0, 25.0, 100.0)
"""Time constants over which a memory may be spread besides its own [s]."""


def forms(course: Course, response: Response, placed: Sequence[Placed], given: Sequence[Placed] = ()) -> np.ndarray:
    """Return columns at one standard deviation, shape (n, streams, k), float32; k is 0 without placed effects.

    A large effect whose equation is a little wrong leaves what small effects explain: what lies along these columns is
    no evidence of another one.
    """
    streams, every = Streams.of(course), list(given)
    if not placed:
        return np.zeros((len(course.read), streams.count, 0), dtype=np.float32)
    columns: list[np.ndarray] = []
    whole = predict(course, response, [*every, *placed])
    for at in range(len(placed)):
        rest = predict(course, response, [*every, *(p for k, p in enumerate(placed) if k != at)])
        own, effect = streams.predicted(whole) - streams.predicted(rest), placed[at].effect
        columns += [effect.form_error * own * by for by in modulations(course, streams, own)]
        if effect.memory_error:
            columns += [effect.memory_error * by for by in _spread(course, streams, whole, rest)]
    return np.stack(columns, axis=-1).astype(np.float32)


def _spread(course: Course, streams: Streams, whole: Prediction, rest: Prediction) -> list[np.ndarray]:
    """Return how a contribution changes where its memory has further time constants, each of shape (n, streams).

    First-order means of differences of first-order means are differences of others: what is left of own - L_tau own are
    the shares that a spectrum of time constants gives to others.
    """
    own = {"signal": whole.signal - rest.signal, "force": whole.force - rest.force, "tag": whole.tag - rest.tag}

    def late(values: np.ndarray, tau: float) -> np.ndarray:
        return low_pass(values, course.step, tau) - values

    return [streams.predicted(replace(whole, **{k: late(v, tau) for k, v in own.items()})) for tau in TIMES]


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
