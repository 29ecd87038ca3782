"""Gauss-Newton refinement: a model's parameters at their optimum on the chain itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Chain, Course, Response, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.fitted_response import FittedResponse, about_means
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.gram import EpisodeGrams, episode_grams
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.noise.whitener import Whitener
from tacdata.discrepancy.regressors.tangent import Knob, tangents
from tacdata.discrepancy.statistics.gram_fit import solve
from tacdata.effects import Placed

MOST_STEPS = 5
"""Gauss-Newton: most steps."""
SMALL_GAIN = 0.2
"""Gauss-Newton: it ends when half the sum of squares falls by less [1]."""
HOPELESS = 0.01
"""Gauss-Newton: a step is not tried if to first order half the sum of squares falls by less [1]."""
CONVERGED = 1.1
"""A fitted response has converged if it leaves at most so much of the residual after its next correction [1]."""


@dataclass(frozen=True)
class Refined:
    """A model with its parameters at the optimum."""

    placed: tuple[Placed, ...]
    response: Response
    energy: np.ndarray
    """Half the whitened sum of squares of each episode, nuisances fitted [1], shape (episodes,)."""
    freedom: float
    """Degrees of freedom that its response takes up [1]; another response has others where effects move the pose."""


def refine(setting: Setting, placed: Sequence[Placed], null: NullModel, steps: int = MOST_STEPS) -> Refined:
    """Fit the numbers of placed effects on the chain itself.

    Args:
        setting: Input of the judgement.
        placed: Effects with a first guess of their numbers.
        null: Null model, kept.
        steps: Most Gauss-Newton steps.
    """
    response = _own(setting.response)
    now = list(placed)
    if isinstance(response, FittedResponse) and now:
        _correct(response, setting, now)
    view = _looked(setting, response, now, null)
    begin = setting, response, now, view
    for _ in range(steps):
        state, best = _state(*begin, null), None
        for share in (1.0, 0.3):
            # A part s of a Newton step makes a quadratic fall by s (2 - s) of the fall of the full step.
            if state.fall * share * (2 - share) < HOPELESS:
                continue
            there = now
            for knob, by in zip(state.knobs, share * state.move, strict=True):
                # A shape moves by its logarithm. Beyond a factor of e^1.5 its derivative is no guide.
                there = knob.moved(there, float(np.clip(by, -1.5, 1.5) if knob.shape else by))
            fresh = _own(response)
            if isinstance(fresh, FittedResponse):
                _correct(fresh, setting, there)
            tried = _looked(replace(setting, response=fresh), fresh, there, null)
            if tried.energy.sum() < view.energy.sum() - 1e-6:
                best = tried, there, fresh
                break
        if best is None:
            break
        gained = view.energy.sum() - best[0].energy.sum()
        view, now, response = best
        begin = replace(setting, response=response), response, now, view
        if gained < SMALL_GAIN:
            break
    return Refined(tuple(now), response, view.energy, view.whitener.freedom)


def _own(response: Response) -> Response:
    """Return a response that may be corrected."""
    return response.copied() if isinstance(response, FittedResponse) else response


def corrected(setting: Setting, placed: Sequence[Placed]) -> Response:
    """Return the response given effects of fixed parameters: a fitted one absorbs the rest."""
    if not isinstance(setting.response, FittedResponse) or not placed:
        return setting.response
    response = setting.response.copied()
    _correct(response, setting, placed)
    return response


@dataclass(frozen=True)
class _View:
    """Residual of a model, nuisances fitted."""

    clean: np.ndarray
    """Whitened residual [1], shape (m, streams, 1)."""
    whitener: Whitener
    """Cleaner of its nuisances."""
    energy: np.ndarray
    chain: Chain | None
    """The run that predicts it, where it is kept."""


@dataclass(frozen=True)
class _State:
    """Where a model may go from there."""

    knobs: list[Knob]
    move: np.ndarray
    fall: float
    """Of half the sum of squares by the move, to first order [1]."""


def _looked(setting: Setting, response: Response, placed: list[Placed], null: NullModel) -> _View:
    course, streams = setting.course, Streams.of(setting.course)
    chain = Chain(course, response, [*setting.given, *placed])
    predicted = chain.prediction
    rest = streams.measured(course) - streams.predicted(predicted)
    residual = rest[:, :, None].astype(np.float32)
    whitener = null.whitener_for(replace(setting, response=response), [*setting.given, *placed], predicted)
    clean = whitener.whitened(residual)
    found = episode_grams(clean, course.reduced, null.nuisances, null.inner)
    still = _without(found.gram.sum(axis=0), np.arange(len(null.ridge)), null.ridge)
    energy = _energy(found, still) + _unconverged(rest, course, response, whitener, null.noise.scale)
    return _View(clean, whitener, energy, chain)


def _unconverged(
    rest: np.ndarray, course: Course, response: Response, whitener: Whitener, scale: np.ndarray
) -> np.ndarray:
    """Return the part that a response should have absorbed and did not: half the sum of squares, shape (episodes,).

    The splines' space is projected out of the residual, as if they had absorbed it. Where effects are far from linear
    in load, corrections need not converge. Then that counts.
    """
    if not isinstance(response, FittedResponse) or whitener.features is None:
        return np.zeros(course.episodes)
    keep = course.channels + (course.force is not None)
    after = response.residual_after(rest[:, :keep], whitener.features)
    now, then = (about_means(own[:, :keep] / scale[:keep], course).sum(axis=1) for own in (rest, after))
    return 0.5 * now * max(1 - CONVERGED * float(then.sum()) / max(float(now.sum()), 1e-300), 0.0)


def _state(setting: Setting, response: Response, placed: list[Placed], view: _View, null: NullModel) -> _State:
    course, ridge = setting.course, null.ridge
    moving = tangents(course, response, placed, setting.given, view.chain)
    k = len(moving.knobs)
    clean = view.whitener.whitened(moving.values) if k else moving.values
    both = np.concatenate([view.clean, clean], axis=2)
    found = episode_grams(both, course.reduced, null.nuisances, null.inner)
    rooms = np.array([knob.room(placed) for knob in moving.knobs]).reshape(-1, 2)
    weight = np.concatenate([[0.05 if knob.shape else 1e-6 for knob in moving.knobs], ridge])
    free = np.full(len(ridge), np.inf)
    low = np.concatenate([np.minimum(rooms[:, 0], -1e-12), -free])
    high = np.concatenate([np.maximum(rooms[:, 1], 1e-12), free])
    best = solve(found.gram.sum(axis=0), np.arange(k + len(ridge)), weight, low, high)
    fall = float(view.energy.sum() - _energy(found, best).sum()) if k else 0.0
    return _State(moving.knobs, best[:k], fall)


def _without(total: np.ndarray, columns: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    free = np.full(len(columns), np.inf)
    return solve(total, columns, ridge, -free, free) if len(columns) else np.zeros(0)


def _energy(found: EpisodeGrams, values: np.ndarray) -> np.ndarray:
    whole = np.concatenate([[1.0], -values])
    return 0.5 * np.einsum("i,eij,j->e", whole, found.gram, whole)


def _correct(response: FittedResponse, setting: Setting, placed: Sequence[Placed]) -> None:
    """Let a fitted response absorb the effects' residual, twice: they act on it."""
    course, streams = setting.course, Streams.of(setting.course)
    keep = streams.channels + streams.force
    features = taken_up(course, response, [*setting.given, *placed])
    if features is None:
        return
    for _ in range(2):
        predicted = predict(course, response, [*setting.given, *placed])
        residual = streams.measured(course) - streams.predicted(predicted)
        response.correct(residual[:, :keep], features)
