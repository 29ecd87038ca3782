"""A course, a response and a model spec's effects, ready to be tested: columns, noise, Gram matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy import evidence, noise
from tacdata.discrepancy.candidates import Board, Candidate, build
from tacdata.discrepancy.cleaner import Cleaner
from tacdata.discrepancy.evidence import Evidence, Noise
from tacdata.discrepancy.fit import fold_of, solve
from tacdata.discrepancy.fitted_response import contexts
from tacdata.discrepancy.forms import forms
from tacdata.discrepancy.generic import depth_slope, generic, slow
from tacdata.discrepancy.spline_response import taken_up
from tacdata.discrepancy.streams import Streams
from tacdata.discrepancy.tangent import Tangent, tangents
from tacdata.discrepancy.wander import wander
from tacdata.effects import Effect, Placed, load

NUISANCE = {"channel_gain": 0.05}
"""What calibration leaves open of a response that was not fitted: standard deviations in the effects' own units."""
AMPLITUDES = ("gain", "modulus")
"""What all channels' gains have in common: read off their calibration too, and not to be told apart."""
IDLE = 0.01
"""Standard deviation of what is known of the readings without load, of the largest rise [1]."""
JITTER = (0.02, 0.02, 0.01)
"""Standard deviation of an episode's own errors of x, y and depth [mm] where the response is not fitted."""
MODEL = 0.003
"""What any response is off at least, in each stream of an episode, as a standard deviation of its rise [1]."""
FITTED_JITTER = 0.01
"""The same of depth for a fitted response, over the stroke [1]."""


@dataclass(frozen=True)
class Setting:
    """What is judged, and with what."""

    course: Course
    response: Response
    effects: Sequence[Effect]
    """The library."""
    nuisance: dict[str, float] = field(default_factory=lambda: dict(NUISANCE))
    """Effect -> prior standard deviation, for a response that is not fitted."""
    given: tuple[Placed, ...] = ()
    """Effects that the model has already, with their numbers fixed."""
    decoys: bool = True
    """Whether effects race with copies of all by chance; without, each is tested alone (to see what that costs)."""


@dataclass(frozen=True)
class Frame:
    """What stays the same while effects come and go: nuisances and noise, of the model as it was given."""

    context: np.ndarray
    """Group of rows that share features, of the rows read, shape (m,), int64."""
    features: np.ndarray | None
    """What the response may take up [1], shape (m, k)."""
    errors: np.ndarray
    """What an episode's own errors of pose change [each stream's unit], shape (m, streams, kinds)."""
    ridge: np.ndarray
    """Weights of their priors [1], shape (k,)."""
    beside: np.ndarray
    """Columns of nuisances, then those that belong to no effect, whitened and cleaned [1], shape (m, streams, k)."""
    nuisances: np.ndarray
    """Those of nuisances alone [1], shape (m, streams, nuisances)."""
    inner: np.ndarray
    """Their Gram matrices [1], shape (episodes, nuisances, nuisances)."""
    noise: Noise
    """Noise as an over-rich fit leaves it."""
    folds: np.ndarray
    """Fold of each episode, shape (episodes,), int64."""
    known: Cleaner
    """Takes nuisances out of columns, beside the model as it was given."""

    @classmethod
    def of(
        cls, reduced: Course, context: np.ndarray, features: np.ndarray | None, errors: np.ndarray, ridge: np.ndarray,
        beside: np.ndarray, noise: Noise, folds: np.ndarray, known: Cleaner | None = None,
    ) -> Frame:  # fmt: skip
        """Return a frame of the rows read, with what follows from its parts."""
        nuisances = np.ascontiguousarray(beside[:, :, : len(ridge)])
        return cls(
            context, features, errors, ridge, beside, nuisances, evidence.summed(nuisances, reduced).gram, noise, folds,
            known or Cleaner(reduced, noise, context, features, errors),
        )  # fmt: skip

    def cleaner(self, course: Course, features: np.ndarray | None) -> Cleaner:
        """Return what takes nuisances out of columns beside a response that may take up given features."""
        before = self.known.features
        if features is before or (features is not None and before is not None and np.array_equal(features, before)):
            return self.known
        return Cleaner(course.reduced, self.noise, self.context, features, self.errors)


@dataclass(frozen=True)
class Problem:
    """One state of the model with everything that may be missing beside it."""

    setting: Setting
    frame: Frame
    placed: tuple[Placed, ...]
    board: Board
    evidence: Evidence
    tangent: Tangent
    """Columns by which what is placed already may still move."""
    forms: np.ndarray
    """Columns of what the equations of what is placed may be off about, from 0, shape (k,), int64."""
    nuisances: np.ndarray
    """Columns of nuisances, from 0, shape (k,), int64."""
    generic: np.ndarray
    """Columns that belong to no effect, from 0, shape (k,), int64."""
    rise: float
    """What presses add to all readings, root of the sum of squares in noise scales [1]."""
    numerics: int | None = None
    """Column of what the response itself is off about, from 0; None if it has no numerics."""

    @property
    def candidates(self) -> list[Candidate]:
        """Everything that may be missing."""
        return self.board.candidates

    @property
    def ridge(self) -> np.ndarray:
        """Weight of each nuisance's prior, shape (k,)."""
        return self.frame.ridge

    @property
    def fixed(self) -> np.ndarray:
        """Columns that stand beside every candidate: nuisances, what is placed, what its forms may be off about."""
        return np.concatenate([self.nuisances, self.tangent.columns, self.forms]).astype(int)

    def fixed_ridge(self, moving: float) -> np.ndarray:
        """Return the weights of their priors; ``moving``: of what is placed [1]."""
        return np.concatenate([self.ridge, np.full(len(self.tangent.columns), moving), np.ones(len(self.forms))])

    @property
    def folds(self) -> np.ndarray:
        """Fold of each episode, shape (episodes,)."""
        return self.frame.folds


def frame(setting: Setting) -> Frame:
    """Return what stays the same, for a model without further effects."""
    course, response = setting.course, setting.response
    reduced, streams = course.reduced, Streams.of(course)
    said = predict(course, response, list(setting.given))
    context, features = contexts(reduced), taken_up(course, response, setting.given)
    errors = jitter(setting, setting.given)
    extra, ridge = nuisance_columns(setting, setting.given)
    rich = generic(course, response, list(setting.given))
    residual = streams.measured(course) - streams.predicted(said)
    every = np.concatenate([extra, rich, slow(course, response, list(setting.given))], axis=2)
    known = told(residual.astype(np.float32), every, reduced, context, features, errors)
    rise = streams.predicted(said).astype(np.float32)
    rise[:, : course.channels] -= response.signal(np.zeros((1, course.channels)))
    rise[:, course.channels + (course.force is not None) :] = 0.0
    prior = errors
    for _ in range(ROUNDS):
        # Errors of pose and of gain explain much of the same: each is told beside the other.
        errors = prior * _jitter_told(residual, every, reduced, known, context, features, prior)
        known = replace(known, swing=None)
        spread = _swing_told(residual, every, reduced, known, context, features, errors, rise)
        known = replace(known, swing=(rise * max(spread, MODEL)).astype(np.float32))
    cleaner = Cleaner(reduced, known, context, features, errors)
    beside = cleaner.cleaned(every[:, :, : extra.shape[2] + rich.shape[2]])
    folds = fold_of(course.episodes)
    return Frame.of(reduced, context, features, errors, ridge, beside, known, folds, cleaner)


def prepare(setting: Setting, frame: Frame, placed: Sequence[Placed] = ()) -> Problem:
    """Build columns beside what is placed and reduce them.

    Args:
        setting: What is judged.
        frame: Its nuisances and noise.
        placed: Effects that the model has.
    """
    course, response = setting.course, setting.response
    # A force reading tells a stiffer skin from a larger gain: then only the gain is left to calibration.
    common = AMPLITUDES[:1] if course.force is not None else AMPLITUDES
    taken = () if response.fitted else (*setting.nuisance, *common)
    board = build(course, response, [*setting.given, *placed], setting.effects, taken)
    moving = tangents(course, response, placed, setting.given)
    off = forms(course, response, placed, setting.given)
    count = board.values.shape[2] - 1
    numerics = _numerics(setting, placed)
    slack = count + moving.values.shape[2]
    last = slack + off.shape[2]
    first = last + (numerics is not None)
    values = np.concatenate([board.values, moving.values, off, *([] if numerics is None else [numerics])], axis=2)
    features = taken_up(course, response, [*setting.given, *placed])
    found = frame.cleaner(course, features).collected(values, frame.beside)
    second = first + len(frame.ridge)
    nuisances, rich = np.arange(first, second), np.arange(second, first + frame.beside.shape[2])
    board = replace(board, values=board.values[:, :, :1])
    return Problem(
        setting, frame, tuple(placed), board, found, moving.at(count), np.arange(slack, last), nuisances, rich,
        _rise(setting, frame), None if numerics is None else last,
    )  # fmt: skip


def _numerics(setting: Setting, placed: Sequence[Placed]) -> np.ndarray | None:
    """Return what a response is off about, shape (m, streams, 1); None where it has no numerics."""
    rough = setting.response.rougher()
    if rough is None:
        return None
    streams, every = Streams.of(setting.course), [*setting.given, *placed]
    now, other = (streams.predicted(predict(setting.course, r, every)) for r in (setting.response, rough))
    return (now - other)[:, :, None].astype(np.float32)


def _rise(setting: Setting, frame: Frame) -> float:
    course = setting.course
    said = predict(course, setting.response, list(setting.given)).signal[course.read]
    rise = said - setting.response.signal(np.zeros((1, course.channels)))
    return float(np.sqrt(np.sum(np.square(rise / frame.noise.scale[: course.channels]))))


ROUNDS = 2
"""How often errors of pose and of gain are told beside each other [1]."""
LEAST, MOST = 0.1, 10.0
"""Errors of pose are told to be between these, in standard deviations of the prior [1]."""


def _jitter_told(
    residual: np.ndarray, rich: np.ndarray, course: Course, known: Noise, context: np.ndarray,
    features: np.ndarray | None, errors: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return how large episodes' own errors of pose are [prior sizes], shape (kinds,).

    Told by successive episodes of the same place, as an offset that differs from place to place is no error of an
    episode's own; by successive ones anywhere where places are not visited again.
    """
    left = _rich_left(residual, rich, course, known, context, features, errors)
    columns = np.concatenate([left[:, :, None].astype(np.float32), errors], axis=2)
    gram = Cleaner(course, known, context, features, np.zeros_like(errors[:, :, :1])).collected(columns).gram
    there = gram[:, 0, 0] > 0  # sealed episodes say nothing
    place = np.zeros(course.episodes, dtype=np.int64)
    place[course.episode] = context
    gram, place = gram[there], place[there]
    kinds = errors.shape[2]
    inner = gram[:, 1:, 1:] + 1e-3 * np.eye(kinds)
    found = np.linalg.solve(inner, gram[:, 1:, :1])[:, :, 0]
    variance = np.diagonal(np.linalg.inv(inner), axis1=1, axis2=2)
    order = np.argsort(place, kind="stable")
    again = np.diff(place[order]) == 0
    if again.sum() < noise.FEW_GAPS:
        order, again = np.arange(len(place)), np.ones(max(len(place) - 1, 0), dtype=bool)
    before, after = order[:-1][again], order[1:][again]
    spread = [
        noise.spread_of(found[after, k] - found[before, k], variance[after, k] + variance[before, k])
        for k in range(kinds)
    ]
    return np.clip(spread, LEAST, MOST) if len(before) >= noise.FEW_GAPS else np.ones(kinds)


def _swing_told(
    residual: np.ndarray, rich: np.ndarray, course: Course, known: Noise, context: np.ndarray,
    features: np.ndarray | None, errors: np.ndarray, rise: np.ndarray,
) -> float:  # fmt: skip
    """Return how far an episode's gain of a stream is off the next one's at its place [1]."""
    local = noise.number_within(context, course.episode)
    apart = rise[:, :, None] * (local[:, None, None] == np.arange(local.max() + 1))
    bare = _rich_left(residual, rich, course, known, context, features, errors)
    both = np.concatenate([bare[:, :, None], apart], axis=2)
    white = Cleaner(course, known, context, features, errors).cleaned(both)
    return noise.gain_spread(white[:, :, 0], white[:, :, 1:], context)


def _rich_left(
    residual: np.ndarray, rich: np.ndarray, course: Course, known: Noise, context: np.ndarray,
    features: np.ndarray | None, errors: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return what an over-rich fit leaves of a residual, shape (m, streams)."""
    columns = np.concatenate([residual[:, :, None].astype(np.float32), rich], axis=2)
    gram = Cleaner(course, known, context, features, errors).collected(columns).of(np.arange(course.episodes))
    free = np.full(rich.shape[2], np.inf)
    best = solve(gram, np.arange(rich.shape[2]), np.full(rich.shape[2], 1.0), -free, free)
    return residual - rich @ best.astype(np.float32)


def told(
    residual: np.ndarray, rich: np.ndarray, course: Course, context: np.ndarray, features: np.ndarray | None,
    errors: np.ndarray,
) -> Noise:  # fmt: skip
    """Return the noise, told from what an over-rich fit of columns that belong to no effect leaves of a residual."""
    known = noise.first_guess(residual, course)
    columns = np.concatenate([residual[:, :, None], rich], axis=2)
    every = np.arange(rich.shape[2])
    free = np.full(len(every), np.inf)
    for _ in range(2):
        gram = Cleaner(course, known, context, features, errors).collected(columns).of(np.arange(course.episodes))
        best = solve(gram, every, np.full(len(every), 1.0), -free, free)
        left = (residual - rich @ best.astype(np.float32)) / known.scale
        still = noise.still(known, left.shape[1])
        cleaner = Cleaner(course, still, context, features, errors / known.scale[None, :, None])
        bare = cleaner.cleaned(left[:, :, None])[:, :, 0]
        bare[~np.isfinite(residual)] = np.nan
        known = noise.refined(bare * known.scale, course, known)
    rest = residual - rich @ best.astype(np.float32)
    wandering = wander(rest, course, known.scale, known.memory, levels(course, context, features is not None))
    return replace(known, wander=wandering, tag=noise.tag_wander(rest, course, known))


def levels(course: Course, context: np.ndarray, fitted: bool) -> list[np.ndarray]:
    """Return the kinds of levels that offsets have, each as a number an episode, shape (episodes,).

    A session has a level of its own; where the response is fitted, each of its places has one too.
    """
    place = np.zeros(course.episodes, dtype=np.int64)
    place[course.episode] = context
    return [course.session, place] if fitted else [course.session]


def nuisance_columns(setting: Setting, placed: Sequence[Placed]) -> tuple[np.ndarray, np.ndarray]:
    """Return the nuisances' columns (n, streams, k) and the weights of their priors (k,); none if fitted."""
    course, response = setting.course, setting.response
    if response.fitted:
        width = course.channels + (course.force is not None) + 3 * (course.tag is not None)
        return np.zeros((len(course.read), width, 0), dtype=np.float32), np.zeros(0)
    effects = [load(name) for name in setting.nuisance]
    board = build(course, response, placed, effects)
    idle = np.zeros((len(course.read), board.values.shape[1], course.channels), dtype=np.float32)
    said = predict(course, response, placed).signal[course.read] - response.signal(np.zeros((1, course.channels)))
    idle[:, np.arange(course.channels), np.arange(course.channels)] = IDLE * float(np.abs(said).max())
    weights = [
        (p.typical / setting.nuisance[c.effect.name]) ** 2
        for c in board.candidates
        for p in c.effect.amplitudes
        for _ in range(len(c.columns) // len(c.effect.amplitudes))
    ]
    return np.concatenate([board.values[:, :, 1:], idle], axis=2), np.array([*weights, *np.ones(course.channels)])


def jitter(setting: Setting, placed: Sequence[Placed]) -> np.ndarray:
    """Return what an episode's own errors of pose change, at one standard deviation, shape (n, streams, kinds)."""
    course, response = setting.course, setting.response
    slope = depth_slope(course, response, list(placed))
    if response.fitted:
        return slope[:, :, None] * FITTED_JITTER * course.stroke
    sideways = build(course, response, placed, [load("xy_offset")])
    shift = sideways.candidates[0].effect.amplitudes[0].typical if sideways.candidates else 1.0
    parts = [slope[:, :, None] * JITTER[2]]
    if sideways.candidates:
        parts.append(sideways.values[:, :, 1:] * (JITTER[0] / shift))
    return np.concatenate(parts, axis=2)
