"""Candidates: contribution of every effect to these recordings, as columns to regress the residual on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from tacdata.chain import Chain, Course, Response
from tacdata.discrepancy.data.streams import Streams
from tacdata.effects import Effect, Placed

MOST_CHANNELS = 32
"""Up to so many channels, a parameter per channel has a column each; beyond, one for all."""


SMALL_SHARES = (0.1, 0.02)
"""Effects with a threshold are tried at these shares of their typical size, too..."""
ALIKE = 0.95
"""...if their column there differs: cosine to that at the larger size [1]."""


Form = tuple[str, tuple[float, ...]]
"""An effect's name, and its shapes."""


@dataclass(frozen=True)
class Candidate:
    """An effect at one choice of its shapes."""

    effect: Effect
    shapes: dict[str, float]
    columns: np.ndarray
    """Its columns, from 0, shape (k,), int64."""
    low: np.ndarray
    """Least coefficients [typical sizes], shape (k,)."""
    high: np.ndarray
    """Largest coefficients [typical sizes], shape (k,)."""

    @property
    def called(self) -> str:
        """The mechanism's name."""
        return self.effect.called

    @property
    def form(self) -> Form:
        """The effect's name and its shapes: the same whatever else is placed."""
        return self.effect.name, tuple(self.shapes.values())

    def placed(self, coefficients: np.ndarray, channels: int) -> Placed:
        """Return the effect with the parameters that coefficients stand for."""
        values = {name: np.array(value) for name, value in self.shapes.items()}
        at = 0
        for p in self.effect.amplitudes:
            width = channels if p.per_channel and channels <= MOST_CHANNELS else 1
            sizes = coefficients[at : at + width] * p.typical
            if p.per_channel:
                values[p.name] = np.broadcast_to(sizes, (channels,)).copy()
            else:
                values[p.name] = np.array(float(sizes[0]))
            at += width
        return Placed(self.effect, values)


@dataclass(frozen=True)
class CandidateColumns:
    """All candidates with their columns."""

    columns: list[np.ndarray]
    """Residual first, then columns [each stream's unit], shape (n, streams) each, float32."""
    candidates: list[Candidate]
    unjudgeable: dict[str, str]
    """Effect -> why these recordings cannot show it."""


def build(
    course: Course,
    response: Response,
    placed: Sequence[Placed],
    effects: Sequence[Effect],
    absorbed: Collection[str] = (),
    among: Collection[Form] | None = None,
) -> CandidateColumns:
    """Predict, and differentiate the chain by every effect at its typical size.

    Args:
        course: The recordings.
        response: Input of the chain.
        placed: Effects that the model has already.
        effects: Effects to try.
        absorbed: Names of effects that calibration takes up.
        among: Effects and shapes that are tried; all, unless given.
    """
    streams = Streams.of(course)
    chain = Chain(course, response, placed)
    baseline = streams.predicted(chain.prediction)
    columns = [(streams.measured(course) - baseline).astype(np.float32)]
    candidates: list[Candidate] = []
    unjudgeable: dict[str, str] = {}
    for effect in effects:
        reason = _unjudgeable(effect, course, response) or _absorbed(effect, absorbed)
        if reason:
            unjudgeable[effect.name] = reason
            continue
        shares = SMALL_SHARES
        for shapes in _shapes(effect):
            if among is not None and (effect.name, tuple(shapes.values())) not in among:
                continue
            full, low, high = _columns(effect, shapes, course, chain, placed, streams, baseline)
            sizes = [full]
            for share in shares:
                # Effects with a threshold, such as play, are not linear in their size: a small one has another column.
                small, _, _ = _columns(effect, shapes, course, chain, placed, streams, baseline, share)
                if not _unlike(sizes[-1], small):
                    shares = shares[: shares.index(share)]  # A threshold is one at all times and lengths, or at none.
                    break
                sizes.append(small)
            for columns_of in sizes:
                index = np.arange(len(columns) - 1, len(columns) - 1 + len(columns_of))
                columns += columns_of
                candidates.append(Candidate(effect, shapes, index, np.array(low), np.array(high)))
    return CandidateColumns(columns, candidates, unjudgeable)


class StandIn(Response):
    """A response without channels, for queries of effects about fitted ones and others."""

    def __init__(self, fitted: bool) -> None:
        """Say whether it was fitted."""
        self.fitted = fitted

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return nothing."""
        return np.zeros((len(pose), 1))

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return nothing."""
        return np.zeros(len(pose))

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return the loads."""
        return load


def _unjudgeable(effect: Effect, course: Course, response: Response) -> str:
    """Return why an effect cannot be judged; a tag sees the part that a fitted response would absorb."""
    if response.fitted and course.tag is not None and effect.seen_by_tag:
        return effect.unjudgeable(course, StandIn(False))
    return effect.unjudgeable(course, response)


def _absorbed(effect: Effect, absorbed: Collection[str]) -> str:
    """Return why an effect is not tried by itself: an effect that calibration absorbs cannot be tested with it."""
    return "read off the calibration of each channel's gain" if effect.name in absorbed else ""


def _unlike(first: list[np.ndarray], second: list[np.ndarray]) -> bool:
    """Return whether two sets of columns of one effect point elsewhere."""
    overlap = sum(float(np.vdot(a, b)) for a, b in zip(first, second, strict=True))
    sizes = [sum(float(np.vdot(a, a)) for a in columns) for columns in (first, second)]
    return overlap < ALIKE * float(np.sqrt(sizes[0] * sizes[1]))


def _shapes(effect: Effect) -> list[dict[str, float]]:
    names = [p.name for p in effect.shapes]
    return [dict(zip(names, values, strict=True)) for values in product(*(p.grid for p in effect.shapes))]


def _columns(
    effect: Effect,
    shapes: dict[str, float],
    course: Course,
    chain: Chain,
    placed: Sequence[Placed],
    streams: Streams,
    baseline: np.ndarray,
    share: float = 1.0,
) -> tuple[list[np.ndarray], list[float], list[float]]:
    """Return the change by an effect at a share of its typical sizes, over that share, and the bounds."""
    result, low, high = [], [], []
    defaults = {
        p.name: np.full(course.channels, p.default) if p.per_channel else np.array(p.default) for p in effect.amplitudes
    }
    defaults |= {name: np.array(value) for name, value in shapes.items()}
    for p in effect.amplitudes:
        values = {**defaults, p.name: defaults[p.name] + share * p.typical}
        change = streams.predicted(chain.again([*placed, Placed(effect, values)])) - baseline
        change = (change / share).astype(np.float32)
        if p.per_channel and course.channels <= MOST_CHANNELS:
            for channel in range(course.channels):
                single = np.zeros_like(change)
                single[:, channel] = change[:, channel]
                result.append(single)
        else:
            result.append(change)
        count = len(result) - len(low)
        low += [p.low / p.typical] * count
        high += [p.high / p.typical] * count
    return result, low, high
