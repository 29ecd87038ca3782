"""Gauss-Newton refinement: a model's parameters at their optimum on the chain itself, with cluster-robust errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import ndtri, stdtrit

from tacdata.chain import Chain, Course, Response, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.fitted_response import FittedResponse, about_means
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.gram import EpisodeGrams, episode_grams
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.noise.whitener import Whitener
from tacdata.discrepancy.regressors.tangent import Knob, knobs_of, tangents
from tacdata.discrepancy.statistics.gram_fit import solve
from tacdata.effects import Placed

MOST_STEPS = 5
"""Gauss-Newton: most steps."""
SMALL_GAIN = 0.2
"""Gauss-Newton: it ends when half the sum of squares falls by less [1]."""
HOPELESS = 0.01
"""Gauss-Newton: a step is not tried if to first order half the sum of squares falls by less [1]."""
KNOWN = 0.5
"""A shape is known if its standard error is smaller [its value]."""
LARGEST_LEVERAGE = 0.9
"""CR3: largest leverage of an episode [1]."""
CONVERGED = 1.1
"""A fitted response has converged if it leaves at most so much of the residual after its next correction [1]."""


@dataclass(frozen=True)
class Refined:
    """A model with its parameters at the optimum."""

    placed: tuple[Placed, ...]
    response: Response
    knobs: list[Knob]
    """Its numbers."""
    energy: np.ndarray
    """Half the whitened sum of squares of each episode, nuisances fitted [1], shape (episodes,)."""
    left: np.ndarray
    """Whitened residual without nuisances [noise scales], shape (m, streams), float32."""
    episode: np.ndarray
    """Of each of its rows, shape (m,), int64."""
    place: np.ndarray
    """Group of rows that share a response's features, shape (m,), int64."""
    projected_draws: np.ndarray
    """Its residual of the null model's draws of noise [noise scales], shape (m, streams, draws), float32."""
    whitener: Whitener
    """Cleaner of its nuisances, and its response's degrees of freedom."""
    freedom: float
    """Degrees of freedom that its response takes up [1]; another response has others where effects move the pose."""
    ending: Callable[[], _State]
    """Tells where it might go on from its optimum: dear, and asked of few models."""

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the knobs [their steps], as episodes scatter; 1.645 standard errors hold 90 %, shape (knobs, knobs)."""
        return self.ending().covariance

    @property
    def loss(self) -> float:
        """Half the whitened sum of squares, with half the response's degrees of freedom [1]: as a log-likelihood."""
        return float(self.energy.sum()) + 0.5 * self.freedom

    @property
    def half_bic(self) -> float:
        """Half the Bayesian information criterion, with the episodes as the sample [1]."""
        return self.loss + 0.5 * len(self.knobs) * float(np.log(max(len(self.energy), 2)))

    def errors(self, at: int) -> tuple[dict[str, float], tuple[str, ...]]:
        """Return the standard error of each parameter of one effect, in its unit, and the parameters at a bound."""
        error: dict[str, float] = {}
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        for k, knob in enumerate(self.knobs):
            if knob.at == at:
                p, value = knob.parameter, knob.value(self.placed)
                size = float(spread[k]) * (abs(value) if knob.shape else p.typical)
                error[p.name] = max(error.get(p.name, 0.0), size)
        return error, self.bounds(at)

    def bounds(self, at: int) -> tuple[str, ...]:
        """Return the parameters of one effect that are at a bound."""
        bound = []
        for knob in (k for k in self.knobs if k.at == at):
            p, value = knob.parameter, knob.value(self.placed)
            if not knob.shape and p.low < p.default and (value <= p.low * 0.999 or value >= p.high * 0.999):
                bound.append(p.name)
            elif value >= p.high * 0.999:
                bound.append(p.name)
        return tuple(bound)

    def narrowest(self, at: int) -> tuple[str, ...]:
        """Return the shapes of one effect within a standard error of their lower bound, and known: its form ends there.

        One that is not known makes no difference below, as a time constant that is shorter than a reading lasts.
        """
        shapes = [(k, knob) for k, knob in enumerate(self.knobs) if knob.at == at and knob.shape]
        error = np.sqrt(np.maximum(np.diag(self.covariance), 0.0)) if shapes else np.zeros(0)
        return tuple(
            knob.parameter.name
            for k, knob in shapes
            if error[k] < KNOWN and knob.value(self.placed) <= knob.parameter.low * (1.001 + error[k])
        )


def refine(setting: Setting, placed: Sequence[Placed], null: NullModel, steps: int = MOST_STEPS) -> Refined:
    """Fit the numbers of placed effects on the chain itself.

    Args:
        setting: Input of the judgement.
        placed: Effects with a first guess of their numbers.
        null: Null model, kept.
        steps: Most Gauss-Newton steps.
    """
    response = _own(setting.response)
    current = list(placed)
    if isinstance(response, FittedResponse) and current:
        _correct(response, setting, current)
    view = _looked(setting, response, current, null)
    begin, ended = (setting, response, current, view), None
    for _ in range(steps):
        state, best = _state(*begin, null), None
        # The full step, then a shorter one; where both fail, the chain bends too much for a better one.
        for share in (1.0, 0.3):
            # A part s of a Newton step makes a quadratic fall by s (2 - s) of the fall of the full step.
            if state.fall * share * (2 - share) < HOPELESS:
                continue
            trial = current
            for knob, by in zip(state.knobs, share * state.move, strict=True):
                # A shape moves by its logarithm. Beyond a factor of e^1.5 its derivative is no guide.
                trial = knob.moved(trial, float(np.clip(by, -1.5, 1.5) if knob.shape else by))
            fresh = _own(response)
            if isinstance(fresh, FittedResponse):
                _correct(fresh, setting, trial)
            tried = _looked(replace(setting, response=fresh), fresh, trial, null)
            if tried.energy.sum() < view.energy.sum() - 1e-6:
                best = tried, trial, fresh
                break
        if best is None:
            ended = state
            break
        gained = view.energy.sum() - best[0].energy.sum()
        view, current, response = best
        begin = replace(setting, response=response), response, current, view
        if gained < SMALL_GAIN:
            break
    # A run of the chain is large, and most models are never asked.
    later = partial(_state, *begin[:3], replace(view, chain=None), null)
    return Refined(
        tuple(current),
        response,
        knobs_of(current, setting.course.channels),
        view.energy,
        view.left,
        setting.course.reduced.episode,
        null.context,
        null.projected_draws(view.whitener),
        view.whitener,
        view.whitener.freedom,
        later if ended is None else lambda: ended,
    )


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
    left: np.ndarray
    chain: Chain | None
    """The run that predicts it, where it is kept."""


@dataclass(frozen=True)
class _State:
    """Where a model may go from there."""

    knobs: list[Knob]
    move: np.ndarray
    fall: float
    """Of half the sum of squares by the move, to first order [1]."""
    found: EpisodeGrams
    """Of the residual, and the derivatives by knobs and nuisances."""
    best: np.ndarray
    """Coefficients of those."""
    weight: np.ndarray
    """Of their priors [1]."""

    @property
    def covariance(self) -> np.ndarray:
        """Of the knobs."""
        return _covariance(self.found, self.best, self.weight, len(self.knobs))


def _looked(setting: Setting, response: Response, placed: list[Placed], null: NullModel) -> _View:
    course, streams = setting.course, Streams.of(setting.course)
    chain = Chain(course, response, [*setting.given, *placed])
    predicted = chain.prediction
    difference = streams.measured(course) - streams.predicted(predicted)
    residual = difference[:, :, None].astype(np.float32)
    whitener = null.whitener_for(replace(setting, response=response), [*setting.given, *placed], predicted)
    clean = whitener.whitened(residual)
    grams = episode_grams(clean, course.reduced, null.nuisances, null.inner)
    still = _without(grams.gram.sum(axis=0), np.arange(len(null.ridge)), null.ridge)
    remainder = clean[:, :, 0] - null.nuisances @ still.astype(np.float32)
    energy = _energy(grams, still) + _unconverged(difference, course, response, whitener, null.noise.scale)
    return _View(clean, whitener, energy, remainder, chain)


def _unconverged(
    difference: np.ndarray, course: Course, response: Response, whitener: Whitener, scale: np.ndarray
) -> np.ndarray:
    """Return the part that a response should have absorbed and did not: half the sum of squares, shape (episodes,).

    The splines' space is projected out of the residual, as if they had absorbed it. Where effects are far from linear
    in load, corrections need not converge. Then that counts.
    """
    if not isinstance(response, FittedResponse) or whitener.features is None:
        return np.zeros(course.episodes)
    keep = course.channels + (course.force is not None)
    projected = response.residual_after(difference[:, :keep], whitener.features)
    square, square_projected = (
        about_means(values[:, :keep] / scale[:keep], course).sum(axis=1) for values in (difference, projected)
    )
    return 0.5 * square * max(1 - CONVERGED * float(square_projected.sum()) / max(float(square.sum()), 1e-300), 0.0)


def _state(setting: Setting, response: Response, placed: list[Placed], view: _View, null: NullModel) -> _State:
    course, ridge = setting.course, null.ridge
    moving = tangents(course, response, placed, setting.given, view.chain)
    k = len(moving.knobs)
    clean = view.whitener.whitened(moving.values) if k else moving.values
    columns = np.concatenate([view.clean, clean], axis=2)
    grams = episode_grams(columns, course.reduced, null.nuisances, null.inner)
    rooms = np.array([knob.room(placed) for knob in moving.knobs]).reshape(-1, 2)
    # A weak prior: where recordings say little of a shape, its logarithm would run away.
    weight = np.concatenate([[0.05 if knob.shape else 1e-6 for knob in moving.knobs], ridge])
    unbounded = np.full(len(ridge), np.inf)
    low = np.concatenate([np.minimum(rooms[:, 0], -1e-12), -unbounded])
    high = np.concatenate([np.maximum(rooms[:, 1], 1e-12), unbounded])
    total = grams.gram.sum(axis=0)
    best = solve(total, np.arange(k + len(ridge)), weight, low, high)
    still = np.concatenate([np.zeros(k), _without(total, k + np.arange(len(ridge)), ridge)])
    # With the priors: a move that spares nuisances counts, although the readings alone then fit no better.
    fall = float(np.diff([_energy(grams, at).sum() + 0.5 * weight @ at**2 for at in (best, still)])[0])
    return _State(moving.knobs, best[:k], fall, grams, best, weight)


def _without(total: np.ndarray, columns: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    unbounded = np.full(len(columns), np.inf)
    return solve(total, columns, ridge, -unbounded, unbounded) if len(columns) else np.zeros(0)


def _energy(grams: EpisodeGrams, values: np.ndarray) -> np.ndarray:
    weights = np.concatenate([[1.0], -values])
    return 0.5 * np.einsum("i,eij,j->e", weights, grams.gram, weights)


def _covariance(grams: EpisodeGrams, values: np.ndarray, weight: np.ndarray, knobs: int) -> np.ndarray:
    """Return the covariance of the first ``knobs`` parameters: a cluster-robust sandwich over episodes.

    Errors within an episode may depend on each other in any way. Each episode's score is that of a fit without it (CR3,
    the jackknife: Bell & McCaffrey, Survey Methodology 28, 2002, 169). Few episodes estimate their scatter badly. So
    errors are enlarged by the ratio of the t to the normal quantile, with the degrees of freedom that the episodes'
    shares of the information leave: 1.645 of them hold 90 %.
    """
    if not knobs:
        return np.zeros((0, 0))
    total = grams.gram.sum(axis=0)[1:, 1:] + np.diag(weight)
    through = np.linalg.pinv(total[knobs:, knobs:], hermitian=True) @ total[knobs:, :knobs]
    elimination = np.concatenate([np.eye(knobs), -through])
    scores = (grams.gram[:, 1:, 0] - np.einsum("eij,j->ei", grams.gram[:, 1:, 1:], values)) @ elimination
    each = elimination.T @ grams.gram[:, 1:, 1:] @ elimination
    size, vectors = np.linalg.eigh(elimination.T @ total @ elimination)
    good = size > 1e-12 * max(float(size[-1]), 1e-300)
    root = (vectors[:, good] / np.sqrt(size[good])) @ vectors[:, good].T
    heavy, axes = np.linalg.eigh(root @ each @ root)
    # A press with all the information on a parameter has leverage 1: the jackknife without it would divide by zero.
    jackknife = np.einsum("eji,ej->ei", axes, scores @ root) / (1 - np.minimum(heavy, LARGEST_LEVERAGE))
    jackknife = np.einsum("eij,ej->ei", axes, jackknife)
    count, inverse = len(scores), root @ root
    share = np.maximum(np.einsum("ki,eij,kj->ek", inverse, each, inverse), 0.0)
    share = share / np.maximum(share.sum(axis=0), 1e-300)
    # By how evenly episodes carry a parameter (Satterthwaite): a few heavy ones make wide intervals.
    freedom = np.maximum(1 / np.maximum(np.sum(share**2, axis=0), 1e-12) - 1, 1.0)
    wider = stdtrit(freedom, 0.95) / ndtri(0.95)
    return (
        root @ (jackknife.T @ jackknife) @ root * np.outer(wider, wider) * ((count - 1) / count if count > 1 else 1.0)
    )


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
