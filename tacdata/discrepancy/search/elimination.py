"""Backward elimination: every effect of the answer must be needed beside the others, and beyond chance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.search.findings import FoundEffect, RivalModels
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.discrepancy.search.j_test import NEEDED_Z, j_statistic, necessity
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.race import REFITS, Selection, least_p_values
from tacdata.discrepancy.search.rivals import try_rivals
from tacdata.discrepancy.search.score_tests import score_tests
from tacdata.discrepancy.search.shortlist import ALPHA

SWAPS = 4
"""How often a rival may take the place of an effect."""
LARGEST_P = 0.05
"""Corrected p-value from which on an effect is dropped beside others [1]."""


@dataclass(frozen=True)
class Answer:
    """The effects that are needed, and the model with them."""

    findings: tuple[FoundEffect, ...]
    model: Refined
    problem: Problem
    """What may be missing beside it."""
    comparisons: tuple[RivalModels, ...] = ()
    """Of each effect, where rivals were tried."""


def eliminate(setting: Setting, selection: Selection) -> Answer:
    """Drop effects that are not needed, or not beyond chance, and try rivals of the rest.

    Args:
        setting: What is judged.
        selection: The effects that forward selection found.
    """
    answer = _needed(setting, selection, selection.model, SWAPS)
    p = _p_values(setting, selection, answer.model)
    while len(answer.findings) > 1 and max(p) > LARGEST_P:
        # Held-out episodes lie between others: a slow drift helps there, and is no effect.
        weakest = int(np.argmax(p))
        rest = [placed for k, placed in enumerate(answer.model.placed) if k != weakest]
        model = refine(replace(setting, response=answer.model.response), rest, selection.null, REFITS)
        answer = _needed(setting, selection, model, SWAPS)
        p = _p_values(setting, selection, answer.model)
    found = tuple(replace(f, corrected_p=share) for f, share in zip(answer.findings, p, strict=True))
    return replace(answer, findings=found)


def _needed(setting: Setting, selection: Selection, model: Refined, swaps: int) -> Answer:
    """Drop the effects that the others can stand in for, then find those that would do as well in each one's place."""
    placed, null, pooled = list(model.placed), selection.null, selection.tests.pooled
    without: dict[int, Refined] = {}
    need: dict[int, float] = {}
    while len(placed) > 1:
        begin = replace(setting, response=model.response)
        without = {k: refine(begin, placed[:k] + placed[k + 1 :], null, REFITS) for k in range(len(placed))}
        need = {k: necessity(begin, model, r, null, pooled) for k, r in without.items()}
        spare = [k for k in need if need[k] < NEEDED_Z]
        if not spare:
            break
        model = without[min(spare, key=lambda k: without[k].half_bic)]
        placed = list(model.placed)
    if len(placed) == 1:
        without = {0: selection.nothing}
        need = {0: j_statistic(model, selection.nothing, pooled)}
    problem = selection.problem
    if model is not selection.model:
        problem = prepare(replace(setting, response=model.response), null, model.placed)
    made, compared = [], []
    for k in range(len(placed)):
        tried = try_rivals(model, without[k], k, problem, need[k], pooled, selection.late)
        if tried.better is not None and swaps > 0:
            # A rival that was behind to first order is ahead on the chain: it takes the place.
            return _needed(setting, selection, tried.better, swaps - 1)
        made.append(tried.finding)
        compared.append(tried.comparison)
    return Answer(tuple(made), model, problem, tuple(compared))


def _p_values(setting: Setting, selection: Selection, model: Refined) -> list[float]:
    """Return each effect's corrected p-value: of the step that asked for it, or beside the others."""
    least, result = dict(selection.least_p), []
    for at, placed in enumerate(model.placed):
        called = placed.effect.called
        p = least.get(called, 1.0)
        if p > ALPHA:
            others = [p for k, p in enumerate(model.placed) if k != at]
            bare = prepare(replace(setting, response=model.response), selection.null, others)
            beside = dict(least_p_values(bare, score_tests(bare), ()))
            p = min(p, beside.get(called, 1.0))
        result.append(p)
    return result
