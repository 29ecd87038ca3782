"""Rivals: which other effects explain the episodes as well in the place of one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.findings import FoundEffect
from tacdata.discrepancy.search.fits import best_shapes, fitted
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import ModelError, Pooled, j_statistic, necessity
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.shortlist import RIVAL_Z, TOP
from tacdata.discrepancy.statistics.gram_fit import clipped_t, gains
from tacdata.effects import Effect

LEAST_MARGIN = 1.0
"""Rivals: least margin by which one is out, however rare it is [standard errors]."""
CLOSE = 0.5
"""Rivals: effects with this share of the best first-order gain are tried [1]."""
FAR_Z, BEHIND = 5.0, 0.8
"""Rivals: not tried if behind to first order by so many standard errors, and this share of the gain [1]."""
AHEAD = 1.0
"""Rivals: one that is ahead by so many standard errors takes the effect's place [1]."""
SIMPLER = RIVAL_Z**2 / 2
"""Rivals: one with more numbers is out if half its BIC is larger by so much; as sure as `RIVAL_Z` [1]."""
BOOTSTRAPS = 200
"""Resamplings of the episodes by which selection is judged."""


@dataclass(frozen=True)
class Tried:
    """An effect of the answer with its rivals tried."""

    finding: FoundEffect
    better: Refined | None
    """The model with a rival in its place, where that is ahead."""


def try_rivals(
    setting: Setting, current: Refined, without: Refined, at: int, problem: Problem, pooled: Pooled
) -> Tried:  # fmt: skip
    """Try other effects in the place of one.

    Args:
        setting: What is judged.
        current: The model with all effects.
        without: The model without the one.
        at: Its number.
        problem: The model without any effect, the same noise.
        pooled: Shrinkage priors.
    """
    begin = replace(setting, response=without.response)
    bare = problem if not without.placed else prepare(begin, problem.null, without.placed)
    mine, best = current.placed[at], best_shapes(bare)
    each = _first_order_gains(bare, best)
    need = necessity(setting, current, without, problem.null, pooled)
    everything = np.arange(len(bare.folds))
    margins, losses, rivals = {}, {}, []
    better: Refined | None = None
    for name in _close(current, best, each):
        _, values = fitted(bare, [best[name]], everything)
        first = best[name].placed(values[: len(best[name].columns)], setting.course.channels)
        other = refine(begin, [*without.placed, first], problem.null)
        level = required_margin(mine.effect, best[name].effect)
        margins[name] = j_statistic(current, other, pooled)
        if margins[name] >= level:
            # Its equation may be wrong by a little: what that explains is nothing against it.
            error = ModelError.of(begin, other, problem.null, len(without.placed))
            margins[name] = j_statistic(current, other, pooled, error)
        if (
            margins[name] < -AHEAD
            and (better is None or other.half_bic < better.half_bic)
            and other.half_bic < current.half_bic
            and j_statistic(other, without, pooled) > need
        ):
            better = other
        losses[name] = other.loss - current.loss
        richer = len(other.tangent.knobs) > len(current.tangent.knobs)
        if margins[name] < level and not (richer and other.half_bic > current.half_bic + SIMPLER):
            rivals.append(best[name].called)
    error, bounds = current.errors(at)
    selected = _selected(bare, best, each, mine.effect.called)
    found = FoundEffect(mine, error, bounds, tuple(dict.fromkeys(rivals)), margins, need, losses, selected)
    return Tried(found, better)


def required_margin(mine: Effect, rival: Effect) -> float:
    """Return by how many standard errors an effect must be ahead of a rival [1].

    `RIVAL_Z` where both are as likely beforehand. Prior odds shift it as a likelihood ratio does (half a square of a
    standard score is a log-likelihood). Nothing is so much likelier that the episodes need not support it.
    """
    return float(np.sqrt(max(RIVAL_Z**2 + 2 * np.log(rival.odds / mine.odds), LEAST_MARGIN**2)))


def _first_order_gains(problem: Problem, best: dict[str, Candidate]) -> dict[str, np.ndarray]:
    """Return by how much each effect alone lowers half the sum of squares of each episode, shape (episodes,)."""
    everything, each = np.arange(len(problem.folds)), {}
    for name, candidate in best.items():
        columns, values = fitted(problem, [candidate], everything)
        each[name] = gains(problem.grams.gram, columns, values)
    return each


def _close(current: Refined, best: dict[str, Candidate], each: dict[str, np.ndarray]) -> list[str]:
    """Return the effects worth trying, the best first."""
    score = {name: float(gain.sum()) for name, gain in each.items()}
    top = max(score.values(), default=0.0)
    first = each[max(score, key=lambda n: score[n])] if score else np.zeros(1)
    taken = {p.effect.called for p in current.placed}
    close = [n for n, s in score.items() if s >= CLOSE * top and best[n].called not in taken]
    close = [n for n in close if score[n] > BEHIND * top or clipped_t(first - each[n]) < FAR_Z]
    return sorted(close, key=lambda n: -score[n])[:TOP]


def _selected(
    problem: Problem, best: dict[str, Candidate], each: dict[str, np.ndarray], mechanism: str
) -> float:  # fmt: skip
    """Return the share of bootstrap samples of the episodes in which a mechanism explains most [1]."""
    if not each:
        return 0.0
    names, count = list(each), len(problem.folds)
    fee = np.array([0.5 * len(best[n].columns) * np.log(max(count, 2)) for n in names])
    pick = np.random.default_rng(11).integers(count, size=(BOOTSTRAPS, count))
    table = np.stack([each[n] for n in names])
    top = np.argmax(table[:, pick].sum(axis=2) - fee[:, None], axis=0)
    return float(np.mean([best[names[k]].called == mechanism for k in top]))
