"""Tangent: derivatives of a model by the parameters of the effects that it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Chain, Course, Response
from tacdata.discrepancy.data.streams import Streams
from tacdata.effects import Parameter, Placed

STEP = 0.02
"""Step of the finite differences [typical sizes, or e-folds of a shape]."""


@dataclass(frozen=True)
class Knob:
    """One number of one placed effect."""

    at: int
    """Which placed effect."""
    parameter: Parameter
    channel: int | None
    """Which channel's, for parameters that each has of its own; None: one for all."""

    @property
    def shape(self) -> bool:
        """Whether it is a shape, moved by its logarithm."""
        return bool(self.parameter.grid)

    def value(self, placed: Sequence[Placed]) -> float:
        """Return its value."""
        value = placed[self.at].values[self.parameter.name]
        return float(value if self.channel is None else value[self.channel])

    def moved(self, placed: Sequence[Placed], by: float) -> list[Placed]:
        """Return the effects with it moved by ``by`` typical sizes or e-folds, kept within its bounds."""
        p, result = self.parameter, list(placed)
        goal = self.value(placed) * np.exp(by) if self.shape else self.value(placed) + by * p.typical
        inside = float(np.clip(goal, p.low, p.high))
        value = np.array(placed[self.at].values[p.name], dtype=float).copy()
        if self.channel is None:
            value = np.array(inside)
        else:
            value[self.channel] = inside
        result[self.at] = replace(placed[self.at], values={**placed[self.at].values, p.name: value})
        return result

    def room(self, placed: Sequence[Placed]) -> tuple[float, float]:
        """Return how far it may move down and up, in typical sizes or e-folds."""
        p, value = self.parameter, self.value(placed)
        if self.shape:
            return float(np.log(max(p.low, 1e-9) / value)), float(np.log(p.high / value))
        return (p.low - value) / p.typical, (p.high - value) / p.typical


@dataclass(frozen=True)
class Tangent:
    """Derivatives of all streams by every knob."""

    knobs: list[Knob]
    values: np.ndarray
    """Change a step [each stream's unit], shape (n, streams, knobs), float32."""
    columns: np.ndarray
    """Their place among others, shape (knobs,), int64."""

    def at(self, first: int) -> Tangent:
        """Return the same with columns counted from ``first``."""
        return replace(self, columns=np.arange(first, first + len(self.knobs)))


def knobs_of(placed: Sequence[Placed], channels: int) -> list[Knob]:
    """Return every number that placed effects can be moved by."""
    result = []
    for at, member in enumerate(placed):
        for p in member.effect.parameters:
            result += [Knob(at, p, c) for c in range(channels)] if p.per_channel else [Knob(at, p, None)]
    return result


def tangents(
    course: Course,
    response: Response,
    placed: Sequence[Placed],
    model_effects: Sequence[Placed] = (),
    run: Chain | None = None,
) -> Tangent:
    """Differentiate the chain by all numbers of the placed effects, the other given ones kept.

    Args:
        course: The recordings.
        response: Input of the chain.
        placed: Effects whose numbers move.
        model_effects: Effects whose numbers stay.
        run: The chain of those given, then those placed, where it was run already.
    """
    streams = Streams.of(course)
    knobs = knobs_of(placed, course.channels)
    if not knobs:
        return Tangent([], np.zeros((len(course.read), streams.count, 0), dtype=np.float32), np.zeros(0, dtype=int))
    chain = run or Chain(course, response, [*model_effects, *placed])
    baseline = streams.predicted(chain.prediction)
    values = np.zeros((*baseline.shape, len(knobs)), dtype=np.float32)
    # Numbers of different channels do not touch each other's streams, so one run of the chain serves a whole group.
    for group in _groups(knobs, placed, model_effects):
        steps, trial = {}, list(placed)
        for k in group:
            low, high = knobs[k].room(placed)
            # At its upper bound a parameter is moved downwards.
            step = STEP if high > STEP else -STEP
            if low < step < high:
                steps[k], trial = step, knobs[k].moved(trial, step)
        if not steps:
            continue
        change = streams.predicted(chain.again([*model_effects, *trial])) - baseline
        for k, step in steps.items():
            channels = slice(None) if len(group) == 1 else knobs[k].channel
            values[:, channels, k] = change[:, channels] / step
    return Tangent(knobs, values, np.arange(len(knobs)))


def _groups(knobs: list[Knob], placed: Sequence[Placed], model_effects: Sequence[Placed]) -> list[list[int]]:
    """Return knobs that are moved at once: a parameter of every channel's own, unless something else mixes channels."""
    groups: dict[tuple[int, str, int | None], list[int]] = {}
    for k, knob in enumerate(knobs):
        companions = [*model_effects, *(p for at, p in enumerate(placed) if at != knob.at)]
        is_split = any(p.effect.by_channel for p in companions)
        groups.setdefault((knob.at, knob.parameter.name, knob.channel if is_split else None), []).append(k)
    return list(groups.values())
