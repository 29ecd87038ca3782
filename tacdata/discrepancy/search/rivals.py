"""Rivals: which other effects explain the episodes as well in the place of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.regressors.candidates import Candidate, Form
from tacdata.discrepancy.regressors.spectrum import spectrum
from tacdata.discrepancy.regressors.tangent import Tangent
from tacdata.discrepancy.search.findings import FoundEffect, RivalModels
from tacdata.discrepancy.search.fits import best_shapes, fitted, gained, shape_gains
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import NEEDED_Z, ModelError, Pooled, j_statistic, necessity
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.shortlist import RIVAL_Z, TOP
from tacdata.discrepancy.statistics.gram_fit import clipped_t
from tacdata.effects import Effect, Placed

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
OTHER_FORMS = 2
"""Other forms of the effect's own mechanism that are tried, the best to first order."""
SLACK, PREPARED = 0.8, 12
"""Rivals: ranked given the whole answer, so many are prepared again; slack of `CLOSE`, `BEHIND`, `FAR_Z` [1]."""
ALIKE = 0.7
"""Rivals: shapes are prepared that explain this share of the effect's best one [1]."""
SPECTRUM_STEPS = 3
"""Gauss-Newton steps of a spectrum, which is nearly linear in its shares."""
BOOTSTRAPS = 200
"""Resamplings of the episodes by which selection is judged."""


@dataclass(frozen=True)
class Tried:
    """An effect of the answer with its rivals tried."""

    finding: FoundEffect
    better: Refined | None
    """The model with a rival, or another form, in its place, where that is ahead."""
    comparison: RivalModels
    """The models that were compared."""


def try_rivals(
    current: Refined, without: Refined, at: int, full: Problem, need: float, pooled: Pooled, lags: Sequence[Placed] = ()
) -> Tried:
    """Try other effects in the place of one.

    Args:
        current: The model with all effects.
        without: The model without the one.
        at: Its number.
        full: Candidates in addition to all effects: they rank the rivals that are worth preparing without the one.
        need: The one's necessity.
        pooled: Shrinkage priors.
        lags: Delays and filters to begin with: to first order long ones are not seen.
    """
    begin, tested, null = replace(full.setting, response=without.response), current.placed[at], full.null
    reduced, answer_mechanisms = full.without(at), {p.effect.called for p in current.placed}
    late_ones = {p.effect.name for p in lags}
    explained = shape_gains(reduced)
    best_told = best_shapes(reduced, explained)
    worthwhile = _worth_preparing(
        reduced,
        explained,
        best_told,
        answer_mechanisms,
        lambda e: e.called == tested.effect.called or e.name in late_ones,
    )
    bare = prepare(begin, null, without.placed, tested=False, among=worthwhile)
    best, everything = best_shapes(bare), np.arange(len(bare.folds))
    each = _first_order_gains(bare, best)
    margins, losses, rivals, models = {}, {}, [], {}
    spectra = Spectra(begin, without, null, pooled)
    better: Refined | None = None

    def in_its_place(name: str) -> Refined:
        _, values = fitted(bare, [best[name]], everything)
        first = best[name].placed(values[: len(best[name].columns)], begin.course.channels)
        starts = [first, *(p for p in lags if p.effect.name == name)]
        models_of_starts = [refine(begin, [*without.placed, start], null) for start in starts]
        return min(models_of_starts, key=lambda model: model.half_bic)

    long = [p.effect.name for p in lags if p.effect.called not in answer_mechanisms and p.effect.name in best]
    for name in dict.fromkeys([*_close(answer_mechanisms, best, each), *long]):
        rival = models[name] = in_its_place(name)
        level = required_margin(tested.effect, best[name].effect)
        margins[name], losses[name] = j_statistic(current, rival, pooled), rival.loss - current.loss
        if margins[name] >= level:
            # Its equation may be wrong by a little: the part explained by that does not count against it.
            error = ModelError.of(begin, rival, null, len(without.placed))
            margins[name] = j_statistic(current, rival, pooled, error)
        by_spectra = margins[name] < max(level, RIVAL_Z) and spectra.both(tested.effect, best[name].effect)
        if by_spectra:
            margins[name], losses[name] = spectra.compared(tested.effect, best[name].effect)
        if (
            margins[name] < -AHEAD
            and not _unphysical(rival, current)
            and (better is None or rival.half_bic < better.half_bic)
            and (by_spectra or rival.half_bic < current.half_bic)
            and j_statistic(rival, without, pooled) > (need if margins[name] > -RIVAL_Z else min(need, NEEDED_Z))
        ):
            better = rival
        richer = len(rival.knobs) > len(current.knobs)
        deficit = rival.half_bic - current.half_bic if richer else 0.0
        if stands_in(margins[name], level, deficit, best[name].effect.family is tested.effect.family):
            rivals.append(best[name].called)
    forms: dict[str, float] = {}
    for name in _forms(tested.effect, best, each):
        rival = in_its_place(name)
        forms[name] = j_statistic(current, rival, pooled)
        better_form = forms[name] < -AHEAD and rival.half_bic < current.half_bic
        # A form that contains this one is ahead by chance, or by a part of the other effects' model error.
        wider = rival.placed[-1].effect.nested(rival.placed[-1].values)
        if better_form and wider is not None and wider.effect.name == tested.effect.name:
            better_form = necessity(begin, rival, current, null, pooled) >= NEEDED_Z
        if better is None and better_form and not _unphysical(rival, current):
            better = rival
    error, bounds = current.errors(at)
    unprepared = {name: c for name, c in best_told.items() if name not in best}
    shift = _still(bare) - _still(reduced)
    bootstrap = _chosen(
        bare, best | unprepared, each | {n: g + shift for n, g in _first_order_gains(reduced, unprepared).items()}
    )
    finding = FoundEffect(
        tested,
        error,
        (*bounds, *current.narrowest(at)),
        tuple(dict.fromkeys(rivals)),
        margins,
        need,
        losses,
        _share(bootstrap, lambda e: e.called == tested.effect.called),
        selected_family=_share(bootstrap, lambda e: e.family is tested.effect.family),
        forms=forms,
        bought=without.loss - current.loss,
        unphysical=_only_unphysical(current, best, models),
    )
    return Tried(finding, better, RivalModels(begin, current, without, models, pooled))


@dataclass
class Spectra:
    """Comparison of laws of linear memory by all mixtures of time constants, instead of their own.

    A law of the right mechanism with a wrong mixture may fit worse than one of a wrong mechanism. Two spectra have the
    same number of parameters and differ only in whether the time constants depend on the tool's radius.
    """

    begin: Setting
    without: Refined
    null: NullModel
    pooled: Pooled
    fits: dict[tuple[float, bool], Refined] = field(default_factory=dict)
    """Power of the radius, and whether shares grow with depth -> the best spectrum in the effect's place."""

    @staticmethod
    def both(effect: Effect, rival: Effect) -> bool:
        """Return whether both are such laws, with time constants that depend on different powers of the radius."""
        powers = effect.times_by_radius, rival.times_by_radius
        return None not in powers and powers[0] != powers[1]

    def compared(self, effect: Effect, rival: Effect) -> tuple[float, float]:
        """Return by how many standard errors over episodes the first's is better, and how far the other is behind."""
        law = effect if effect.times_by_radius == 0.0 else rival
        first, second = (self._fit(law, e.times_by_radius or 0.0) for e in (effect, rival))
        return j_statistic(first, second, self.pooled), second.loss - first.loss

    def _fit(self, law: Effect, by_radius: float) -> Refined:
        key = by_radius, law.memory_by_depth
        if key not in self.fits:
            placed = [*self.without.placed, spectrum(law, by_radius)]
            self.fits[key] = refine(self.begin, placed, self.null, SPECTRUM_STEPS)
        return self.fits[key]


def stands_in(margin: float, level: float, deficit: float, kin: bool = True) -> bool:
    """Return whether a rival explains the episodes as well as an effect.

    A rival with more parameters that fits about as well is excluded, unless the episodes prefer it significantly. The
    limit is higher within a family: a law that contains another one always fits a little better.

    Args:
        margin: By how many standard errors over episodes the effect is better (J test).
        level: From which on the rival is out.
        deficit: By how much half the BIC of a rival with more numbers is larger.
        kin: Whether the rival is of the effect's family.
    """
    return margin < level and (deficit <= SIMPLER or margin < -(RIVAL_Z if kin else AHEAD))


def required_margin(effect: Effect, rival: Effect) -> float:
    """Return by how many standard errors an effect must be ahead of a rival [1].

    `RIVAL_Z` where both are as likely beforehand. Prior odds shift it as a likelihood ratio does (half a square of a
    standard score is a log-likelihood). Nothing is so much likelier that the episodes need not support it.
    """
    return float(np.sqrt(max(RIVAL_Z**2 + 2 * np.log(rival.odds / effect.odds), LEAST_MARGIN**2)))


def _unphysical(rival: Refined, current: Refined) -> bool:
    """Return whether only the other model needs an amplitude at a physical bound: it takes no place then."""
    return _bound(rival) and not _bound(current)


def _only_unphysical(current: Refined, best: dict[str, Candidate], models: dict[str, Refined]) -> tuple[str, ...]:
    """Return the mechanisms of which every form that was tried needs an unphysical size."""
    sizes: dict[str, list[bool]] = {}
    for name, rival in models.items():
        sizes.setdefault(best[name].called, []).append(_unphysical(rival, current))
    return tuple(mechanism for mechanism, each in sizes.items() if all(each))


def _bound(model: Refined) -> bool:
    """Return whether an amplitude is at its bound; a shape at its bound only means that the form is another one."""
    return any(set(model.bounds(k)) - {p.name for p in placed.effect.shapes} for k, placed in enumerate(model.placed))


def _worth_preparing(
    reduced: Problem,
    gain: list[float],
    best: dict[str, Candidate],
    answer_mechanisms: set[str],
    always: Callable[[Effect], bool],
) -> set[Form]:
    """Return the effects and shapes that may be close in the place of one.

    Args:
        reduced: Without the one to first order: columns are those given it.
        gain: Part that each of its candidates explains.
        best: Effect -> its best shapes.
        answer_mechanisms: Mechanisms of the whole answer.
        always: Effects that are prepared whatever they explain.
    """
    still = _still(reduced)
    # The others are not at their optimum without the one: the part that their parameters explain is no rival's.
    bare = replace(reduced, model_errors=reduced.model_errors[:0])
    gain_of_effects = _still(bare) - _still(
        replace(bare, tangent=Tangent([], reduced.tangent.values, reduced.tangent.columns[:0]))
    )
    each = {name: own - gain_of_effects for name, own in _first_order_gains(reduced, best).items()}
    near = _close(answer_mechanisms, best, each, SLACK, PREPARED)
    largest = {name: float((own + gain_of_effects - still).sum()) for name, own in each.items()}
    return {
        c.form
        for c, own in zip(reduced.candidates, gain, strict=True)
        if (c.effect.name in near or always(c.effect))
        and own - still.sum() >= largest[c.effect.name] - (1 - ALIKE) * abs(largest[c.effect.name])
    }


def _first_order_gains(problem: Problem, best: dict[str, Candidate]) -> dict[str, np.ndarray]:
    """Return by how much each effect alone lowers half the sum of squares of each episode, shape (episodes,)."""
    everything = np.arange(len(problem.folds))
    return {name: gained(problem, [candidate], everything) for name, candidate in best.items()}


def _still(problem: Problem) -> np.ndarray:
    """Return by how much half the sum of squares of each episode falls without any effect, shape (episodes,)."""
    return gained(problem, [], np.arange(len(problem.folds)))


def _close(
    answer_mechanisms: set[str],
    best: dict[str, Candidate],
    each: dict[str, np.ndarray],
    slack: float = 1.0,
    count: int = TOP,
) -> list[str]:
    """Return the effects worth trying, the best first.

    Args:
        answer_mechanisms: Mechanisms that the answer has.
        best: Effect -> its best shapes.
        each: Effect -> by how much it alone lowers half the sum of squares of each episode.
        slack: Below 1 others count that are farther behind [1].
        count: How many are returned.
    """
    score = {name: float(gain.sum()) for name, gain in each.items()}
    top = max(score.values(), default=0.0)
    first = each[max(score, key=lambda n: score[n])] if score else np.zeros(1)
    close = [n for n, s in score.items() if s >= slack * CLOSE * top and best[n].called not in answer_mechanisms]
    close = [n for n in close if score[n] > slack * BEHIND * top or clipped_t(first - each[n]) < FAR_Z / slack]
    return sorted(close, key=lambda n: -score[n])[:count]


def _forms(effect: Effect, best: dict[str, Candidate], each: dict[str, np.ndarray]) -> list[str]:
    """Return other forms of an effect's mechanism, the best to first order."""
    forms = [n for n, c in best.items() if c.called == effect.called and n != effect.name]
    return sorted(forms, key=lambda n: -float(each[n].sum()))[:OTHER_FORMS]


def _chosen(problem: Problem, best: dict[str, Candidate], each: dict[str, np.ndarray]) -> list[Effect]:
    """Return the effect that explains most of each bootstrap sample of the episodes."""
    if not each:
        return []
    names, count = list(each), len(problem.folds)
    fee = np.array([0.5 * len(best[n].columns) * np.log(max(count, 2)) for n in names])
    pick = np.random.default_rng(11).integers(count, size=(BOOTSTRAPS, count))
    table = np.stack([each[n] for n in names])
    top = np.argmax(table[:, pick].sum(axis=2) - fee[:, None], axis=0)
    return [best[names[k]].effect for k in top]


def _share(sample_effects: list[Effect], among: Callable[[Effect], bool]) -> float:
    """Return the share of bootstrap samples in which one of a kind explains most [1]."""
    return float(np.mean([among(e) for e in sample_effects])) if sample_effects else 0.0
