"""Backward elimination: every effect of the answer must be needed in addition to the others, and beyond chance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.search.findings import FoundEffect, RivalModels
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import NEEDED_Z, Pooled, j_statistic, necessity
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.race import MOST_EFFECTS, REFITS, Selection, least_p_values
from tacdata.discrepancy.search.rivals import try_rivals
from tacdata.discrepancy.search.score_tests import score_tests
from tacdata.discrepancy.search.shortlist import ALPHA
from tacdata.effects import AtRest, Effect, Family, Placed

CHAIN_ERROR = 0.01
"""Two lags: how far the chain may be off about a delay [1]; presses stepped apart show 0.006."""
SWAPS = 4
"""How often a rival may take the place of an effect."""
LARGEST_P = 0.05
"""Corrected p-value from which on an effect is dropped from several [1]."""


@dataclass(frozen=True)
class Answer:
    """The effects that are needed, and the model with them."""

    findings: tuple[FoundEffect, ...]
    model: Refined
    problem: Problem
    """Candidates in addition to it."""
    comparisons: tuple[RivalModels, ...] = ()
    """Of each effect, where rivals were tried."""


def eliminate(setting: Setting, selection: Selection) -> Answer:
    """Drop effects that are not needed, or not beyond chance, and try rivals of the rest.

    Args:
        setting: Input of the judgement.
        selection: The effects that forward selection found.
    """
    answer = _needed(setting, selection, selection.model, SWAPS)
    p = _p_values(setting, selection, answer.model)
    while len(answer.findings) > 1 and max(p) > LARGEST_P:
        # Held-out episodes lie between others: a slow drift helps there, and is no effect.
        weakest = int(np.argmax(p))
        remaining = [placed for k, placed in enumerate(answer.model.placed) if k != weakest]
        model = refine(replace(setting, response=answer.model.response), remaining, selection.null, REFITS)
        answer = _needed(setting, selection, model, SWAPS)
        p = _p_values(setting, selection, answer.model)
    corrected = tuple(replace(f, corrected_p=share) for f, share in zip(answer.findings, p, strict=True))
    return replace(answer, findings=corrected)


def _needed(setting: Setting, selection: Selection, model: Refined, swaps: int) -> Answer:
    """Remove redundant effects, then list the rivals of each remaining one."""
    null, pooled = selection.null, selection.tests.pooled
    model, maybe_two = two_lags(setting, parsimonious(setting, model, null, pooled), selection.nothing, null, pooled)
    placed = list(model.placed)
    without: dict[int, Refined] = {}
    need: dict[int, float] = {}
    while len(placed) > 1:
        begin = replace(setting, response=model.response)
        without = {k: refine(begin, placed[:k] + placed[k + 1 :], null, REFITS) for k in range(len(placed))}
        need = {k: necessity(begin, model, r, null, pooled) for k, r in without.items()}
        spare = [k for k in need if need[k] < NEEDED_Z]
        if not spare:
            break
        # Only one is dropped at a time: of two collinear effects, each is needless only while the other is there.
        model = without[min(spare, key=lambda k: without[k].half_bic)]
        placed = list(model.placed)
    if len(placed) == 1:
        without = {0: selection.nothing}
        need = {0: j_statistic(model, selection.nothing, pooled)}
    problem = selection.problem
    if model is not selection.model:
        problem = prepare(replace(setting, response=model.response), null, model.placed)
    found_effects, compared = [], []
    for k in range(len(placed)):
        tried = try_rivals(model, without[k], k, problem, need[k], pooled, _late(setting, selection, placed[k]))
        if tried.better is not None and swaps > 0:
            # A rival that was behind to first order is ahead on the chain: it takes the place.
            return _needed(setting, selection, tried.better, swaps - 1)
        found_effects.append(_beside_another(setting, tried.finding) if maybe_two else tried.finding)
        compared.append(tried.comparison)
    return Answer(tuple(found_effects), model, problem, tuple(compared))


def parsimonious(setting: Setting, model: Refined, null: NullModel, pooled: Pooled) -> Refined:
    """Return a model with the nested form of effects where that explains the presses as well.

    A form that contains another always fits better.
    """
    for at, placed in enumerate(model.placed):
        form = placed.effect.nested(placed.values)
        if form is None:
            continue
        begin = replace(setting, response=model.response)
        plain = refine(begin, [*model.placed[:at], form, *model.placed[at + 1 :]], null, REFITS)
        if necessity(begin, model, plain, null, pooled) < NEEDED_Z:
            model = plain
    return model


def two_lags(
    setting: Setting, model: Refined, nothing: Refined, null: NullModel, pooled: Pooled
) -> tuple[Refined, bool]:
    """Return a model with two lags where no single one explains the episodes, and whether there may be two.

    To first order all lags are one. The chain itself must distinguish them, each alone and two at a time. A gain within
    the form error of a single one is open. A delay has no such error: a gain beyond the chain's own is a second lag.
    """
    lags = [k for k, p in enumerate(model.placed) if _is_lag(p.effect)]
    if len(lags) != 1 or len(model.placed) >= MOST_EFFECTS:
        return model, False
    at, begin = lags[0], replace(setting, response=model.response)
    single, remaining = model.placed[at], [*model.placed[:at], *model.placed[at + 1 :]]
    lag = _lag(single)
    kin = [e for e in setting.effects if _is_lag(e)]
    pairs = [pair for pair in combinations(kin, 2) if len({e.called for e in pair}) == 2]
    # To first order two lags of half the size equal the single one, so both start where the model is.
    two_lag_models = [refine(begin, [*remaining, *(_behind(e, 0.5 * lag) for e in pair)], null) for pair in pairs]
    best = min(two_lag_models, key=lambda two: two.half_bic, default=model)
    if best.half_bic >= model.half_bic or necessity(begin, best, model, null, pooled) < NEEDED_Z:
        return model, False
    single_lag_models = [
        refine(begin, [*remaining, _behind(e, lag)], null) for e in kin if e.name != single.effect.name
    ]
    if any(necessity(begin, best, rival, null, pooled) < NEEDED_Z for rival in single_lag_models):
        return model, False
    error = single.effect.form_error if single.effect.distributed else CHAIN_ERROR
    large = model.loss - best.loss > error**2 * (nothing.loss - model.loss)
    return (best, False) if large else (model, single.effect.distributed)


def _beside_another(setting: Setting, finding: FoundEffect) -> FoundEffect:
    """Return a lag with all others as its rivals."""
    if not _is_lag(finding.placed.effect):
        return finding
    kin = [e.called for e in setting.effects if _is_lag(e) and e.called != finding.placed.effect.called]
    return replace(finding, rivals=tuple(dict.fromkeys([*finding.rivals, *kin])))


def _late(setting: Setting, selection: Selection, placed: Placed) -> list[Placed]:
    """Return lags to begin with in the place of an effect."""
    if not _is_lag(placed.effect):
        return list(selection.late)
    kin = [_behind(e, _lag(placed)) for e in setting.effects if _is_lag(e) and e.name != placed.effect.name]
    return [*selection.late, *kin]


def _lag(placed: Placed) -> float:
    """Return how far an effect is behind a ramp [s]."""
    return placed.effect.time_constant(placed.values) + placed.effect.delay(placed.values)


def _is_lag(effect: Effect) -> bool:
    """Return whether it is late by one time, whichever way the load goes."""
    lag = effect.family is Family.DELAY_AND_FILTER and effect.at_rest is AtRest.CATCHES_UP
    return lag and [p.unit for p in effect.parameters] == ["s"]


def _behind(effect: Effect, lag: float) -> Placed:
    """Return a lag that is so much behind a ramp [s]."""
    parameter = effect.parameters[0]
    return Placed(effect, {parameter.name: np.asarray(np.clip(lag, parameter.low, parameter.high))})


def _p_values(setting: Setting, selection: Selection, model: Refined) -> list[float]:
    """Return each effect's corrected p-value: of the step that asked for it, or given the others."""
    least_p, result = dict(selection.least_p), []
    for at, placed in enumerate(model.placed):
        mechanism = placed.effect.called
        p = least_p.get(mechanism, 1.0)
        # An effect may have been asked for only after others were there; then it is tested given these.
        if p > ALPHA:
            remaining = [p for k, p in enumerate(model.placed) if k != at]
            bare = prepare(replace(setting, response=model.response), selection.null, remaining)
            p_of_mechanism = dict(least_p_values(bare, score_tests(bare), ()))
            p = min(p, p_of_mechanism.get(mechanism, 1.0))
        result.append(p)
    return result
