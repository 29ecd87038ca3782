"""The race: forward selection of effects, each refined on the chain itself before one is chosen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Response
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import NullModel, null_model
from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.regressors.delays import delays
from tacdata.discrepancy.regressors.model_error import OTHER_FORMS
from tacdata.discrepancy.search.fits import fitted
from tacdata.discrepancy.search.gate import Gate
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import NEEDED_Z, necessity
from tacdata.discrepancy.search.overlap import overlap
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.score_tests import ScoreTests, score_tests
from tacdata.discrepancy.search.shortlist import shortlist
from tacdata.effects import Effect, Placed

MOST_EFFECTS = 4
"""Forward selection: most effects in one verdict."""
REFITS = 3
"""Gauss-Newton steps after the noise was estimated again."""
MINOR = 0.3
"""Forward selection: a further effect must explain this share of the model error that resembles it [1]."""

PHYSICAL = 0.5
"""Forward selection: a set within physical bounds goes first if it explains this share of the best one's part [1]."""

Note = Callable[[str], None]


@dataclass(frozen=True)
class Selection:
    """A model on its way: so many effects selected."""

    null: NullModel
    """Noise and nuisances, estimated given the effects."""
    nothing: Refined
    """The model as it was given, with the same noise."""
    model: Refined
    """The model with the effects."""
    problem: Problem
    """Candidates in addition to them."""
    tests: ScoreTests
    """Of that."""
    explained: tuple[tuple[Effect, float], ...] = ()
    """Each effect with the fall of half the sum of squares by it [1]."""
    least_p: tuple[tuple[str, float], ...] = ()
    """Mechanism -> least corrected p-value so far [1]."""
    late: tuple[Placed, ...] = ()
    """Delays and filters of about the size that readings and path show by themselves."""


def start(setting: Setting, gate: Gate) -> Selection:
    """Return the selection without effects."""
    nothing = refine(setting, [], gate.problem.null)
    least_p = least_p_values(gate.problem, gate.tests, ())
    return Selection(gate.problem.null, nothing, nothing, gate.problem, gate.tests, (), least_p)


def race(setting: Setting, selection: Selection, note: Note) -> Iterator[Selection]:
    """Add effects, or pairs of them, as long as episodes ask for them; yield each selection."""
    selection = replace(selection, late=tuple(delays(setting)))
    while len(selection.model.placed) < MOST_EFFECTS:
        sets = shortlist(selection.problem, selection.tests)
        if not sets:
            break
        tried = dict.fromkeys(" with ".join(c.effect.spoken for c in candidates) for candidates in sets)
        note(f"fit: {', '.join(tried)}")
        best = _winner(selection, sets)
        if best is None or _is_minor(selection, best):
            break
        selection = _added(setting, selection, best)
        note(f"so far: {', '.join(dict.fromkeys(p.effect.spoken for p in selection.model.placed))}")
        yield selection


def _winner(selection: Selection, sets: list[list[Candidate]]) -> Refined | None:
    """Refine each set on the chain; return the best if it is needed, None if none is.

    Args:
        selection: So far; late effects are tried with the first effect, or alone.
        sets: Effects to add.
    """
    lags = selection.late
    problem, everything = selection.problem, np.arange(len(selection.problem.folds))
    tried = []
    for candidates in sets:
        _, values = fitted(problem, candidates, everything)
        first, at = [], 0
        for candidate in candidates:
            candidate_values = values[at : at + len(candidate.columns)]
            first.append(candidate.placed(candidate_values, problem.setting.course.channels))
            at += len(candidate.columns)
        tried.append(refine(problem.setting, [*problem.placed, *first], problem.null))
    # To first order a long delay is not seen. So delays and filters are also started from the lag that readings and
    # path show by themselves.
    if not problem.placed and sets:
        best = [p for p in min(tried, key=lambda model: model.half_bic).placed if p.effect.called not in _called(lags)]
        starts = [[p] for p in lags] + [[p, *best[:1]] for p in lags if best]
        tried += [refine(problem.setting, start, problem.null) for start in starts]
    if not tried:
        return None
    tried = physical_first(tried, selection.model)
    for model in (without_minor(tried, selection.model), tried[0]):
        if necessity(problem.setting, model, selection.model, problem.null, selection.tests.pooled) >= NEEDED_Z:
            return model
    return None


def _called(placed: Sequence[Placed]) -> set[str]:
    return {p.effect.called for p in placed}


def physical_first(tried: list[Refined], current: Refined) -> list[Refined]:
    """Return models, the best first, but those with a number at a physical bound behind those without.

    Candidates at a physical bound are never named. So one within bounds is preferred even if it fits slightly worse.

    Args:
        tried: Models that add to the current one.
        current: It.
    """
    ordered = sorted(tried, key=lambda model: model.half_bic)
    worth = PHYSICAL * (current.half_bic - ordered[0].half_bic)
    preferred = [not _at_bound(m, current) and current.half_bic - m.half_bic >= worth for m in ordered]
    # Two models of the same effects are compared by no number: arrays have no one truth.
    return [m for first in (True, False) for m, is_ahead in zip(ordered, preferred, strict=True) if is_ahead == first]


def _at_bound(model: Refined, current: Refined) -> bool:
    """Return whether a parameter of a model's added effects is at a physical bound."""
    return any(model.bounds(k) for k in range(len(current.placed), len(model.placed)))


def _is_minor(selection: Selection, best: Refined) -> bool:
    """Return whether a model's added effects are within the model error of the effects before."""
    if not selection.model.placed:
        return False
    added = shares(best, len(selection.model.placed), selection.model.loss - best.loss)
    further = [effect for effect, _ in added]
    error = model_error_energy(list(selection.explained), further, best.response, selection.problem)
    return selection.model.loss - best.loss < MINOR * error


def _added(setting: Setting, selection: Selection, best: Refined) -> Selection:
    """Return the selection with a model's effects; its noise is estimated again given them.

    Noise that was estimated without a large effect is too large.
    """
    added = shares(best, len(selection.model.placed), selection.model.loss - best.loss)
    null = null_model(replace(setting, response=best.response, given=(*setting.given, *best.placed)))
    nothing = refine(setting, [], null)
    model = refine(replace(setting, response=best.response), best.placed, null, REFITS)
    problem = prepare(replace(setting, response=model.response), null, model.placed)
    tests = score_tests(problem, seed=len(best.placed))
    least_p = least_p_values(problem, tests, selection.least_p)
    return Selection(null, nothing, model, problem, tests, (*selection.explained, *added), least_p, selection.late)


def least_p_values(
    problem: Problem, tests: ScoreTests, earlier: tuple[tuple[str, float], ...]
) -> tuple[tuple[str, float], ...]:
    """Return the least corrected p-value of each mechanism, earlier tests included."""
    least_p = dict(earlier)
    for candidate, p in zip(problem.candidates, tests.p, strict=True):
        least_p[candidate.called] = min(least_p.get(candidate.called, 1.0), float(p))
    return tuple(least_p.items())


def shares(model: Refined, count: int, more: float) -> list[tuple[Effect, float]]:
    """Return a model's effects but the first ``count``, each with an equal share of the part that they explain."""
    added = [p.effect for p in model.placed[count:]]
    return [(effect, more / len(added)) for effect in added]


def model_error_energy(
    explained: list[tuple[Effect, float]], further: list[Effect], response: Response, problem: Problem | None = None
) -> float:
    """Return the share of further effects' gain that may be the model error of those before them.

    In the unit of ``explained``, as the fall of half the sum of squares. An effect of the same ambiguity group looks
    like another form of a placed one, and takes more of it.

    Args:
        explained: Effects, each with its explained part.
        further: Those that would be added.
        response: Its own error counts, too.
        problem: With model error columns, by which the overlap with a further effect is measured; it is taken as
            complete without.
    """

    def error(effect: Effect) -> float:
        candidates = [c for c in problem.candidates if c.effect.name == effect.name] if problem else []
        alike = overlap(problem, candidates) if problem else 1.0
        kin = [OTHER_FORMS if earlier.group == effect.group else 1.0 for earlier, _ in explained]
        return sum(
            part * (alike * (factor * earlier.form_error) ** 2 + response.form_error**2)
            for factor, (earlier, part) in zip(kin, explained, strict=True)
        )

    return min(error(effect) for effect in further)


def without_minor(tried: list[Refined], current: Refined) -> Refined:
    """Return the best model, or the best with one effect less if the last one's gain is model error.

    Args:
        tried: Models, the best first.
        current: Model that they were added to.
    """
    best = tried[0]
    fewer = [model for model in tried if len(model.placed) < len(best.placed)]
    if not fewer:
        return best
    explained = shares(fewer[0], len(current.placed), current.loss - fewer[0].loss)
    fewer_names = [p.effect.name for p in fewer[0].placed]
    further = [p.effect for p in best.placed if p.effect.name not in fewer_names]
    minor = MINOR * model_error_energy(explained, further or [p.effect for p in best.placed[-1:]], best.response)
    return fewer[0] if fewer[0].loss - best.loss < minor else best
