"""The shortlist: effects, and one pair of effects, worth refining in addition to a model's own."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.fits import best_shapes, gained, held_out
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.search.score_tests import ScoreTests
from tacdata.discrepancy.statistics.gram_fit import clipped_t

ALPHA = 0.01
"""Level of the score tests, corrected for the number of candidates [1]."""
TOP = 8
"""How many effects are tried as parts of pairs and as rivals."""
RIVAL_Z = 2.33
"""J test: a rival as likely beforehand is out from so many standard errors on: 1 %, one-sided [1]."""
BEAM = 5
"""Pairs that the beam search keeps."""
PAIR_Z = 3.0
"""Cross-validation: a pair without a significant part must help by so many standard errors over episodes [1]."""


def shortlist(problem: Problem, tested: ScoreTests) -> list[list[Candidate]]:
    """Return sets of effects worth adding: up to three single ones, and the pair that does better than any of them."""
    excluded = {p.effect.called for p in (*problem.setting.given, *problem.placed)}
    best = best_shapes(problem)
    # Two that these presses cannot split are a set, not a pair.
    excluded |= {name for p in problem.placed for name in lookalikes(problem.setting.course, p.effect, p.values)}
    available = [c for c in best.values() if c.called not in excluded]

    significant = {c.effect.name for c, p in zip(problem.candidates, tested.p, strict=True) if p <= ALPHA}
    ranked = sorted(((_gain(problem, [c]), c) for c in available), key=lambda item: -item[0])
    # The penalty of many parameters, as a drift of each channel has, may hide a finding of the test.
    singles = ranked[:TOP] + [entry for entry in ranked[TOP:] if entry[1].effect.name in significant]
    gains_held_out = {c.effect.name: held_out(problem, [c]) for _, c in singles}
    # Significant, and better on episodes left out: either alone is passed by a stand-in now and then.
    order = [c for _, c in singles if c.effect.name in significant and gains_held_out[c.effect.name].sum() > 0]
    pair = _pair(problem, [c for _, c in singles], available)
    if order:
        best_single = max((gains_held_out[c.effect.name] for c in order), key=lambda h: h.sum())
        better = pair and clipped_t(held_out(problem, pair) - best_single) > RIVAL_Z
        return [[c] for c in _tried(order)] + ([pair] if better else [])
    if tested.p_generic <= ALPHA and pair and clipped_t(held_out(problem, pair)) > PAIR_Z:
        # The first part is tried alone, too: `without_minor` in the race compares the pair with it.
        return [pair[:1], pair]
    return []


def _tried(order: list[Candidate]) -> list[Candidate]:
    """Return which of some candidates, best first, are tried: the best form of three mechanisms, two of the best."""
    forms: dict[str, list[Candidate]] = {}
    for candidate in order:
        forms.setdefault(candidate.called, []).append(candidate)
    return [form for k, same in enumerate(list(forms.values())[:3]) for form in same[: 2 if k == 0 else 1]]


def _gain(problem: Problem, candidates: list[Candidate]) -> float:
    everything = np.arange(len(problem.folds))
    # Half the BIC penalty. The sample is the episodes, not the readings: readings of one press are correlated.
    fee = 0.5 * sum(len(c.columns) for c in candidates) * float(np.log(max(len(problem.folds), 2)))
    return float(gained(problem, candidates, everything).sum()) - fee


def _beside(problem: Problem, first: Candidate, partners: list[Candidate]) -> list[float]:
    """Return the gain of a first effect with each of others, without bounds, less half its BIC penalty."""
    fixed = np.concatenate([problem.fixed, first.columns]).astype(int) + 1
    total = problem.grams.of(np.arange(len(problem.folds)))
    ridge = np.concatenate([problem.fixed_ridge(1.0), np.zeros(len(first.columns))])
    matrix = total[np.ix_(fixed, fixed)] + np.diag(ridge + 1e-9 * max(float(np.trace(total)), 1e-12) / len(total))
    # The Schur complement: each partner then costs a small system instead of the whole one.
    conditional = total - total[:, fixed] @ np.linalg.solve(matrix, total[fixed])
    single_gain, fee = _gain(problem, [first]), 0.5 * float(np.log(max(len(problem.folds), 2)))
    result = []
    for c in partners:
        index = c.columns + 1
        inner = conditional[np.ix_(index, index)]
        weight = 1e-6 * max(float(np.trace(total[np.ix_(index, index)])) / len(index), 1e-12)
        more = 0.5 * conditional[index, 0] @ np.linalg.solve(inner + weight * np.eye(len(index)), conditional[index, 0])
        result.append(single_gain + float(more) - fee * len(index))
    return result


def _pair(problem: Problem, first: list[Candidate], available: list[Candidate]) -> list[Candidate]:
    """Return the pair that predicts left-out episodes best, of the best few of a beam; empty if there is none.

    One effect may hide another: each of the first few is joined with every other effect, whatever that does alone.
    """
    pairs = []
    for a in first[:BEAM]:
        alike = (a.called, *lookalikes(problem.setting.course, a.effect, a.shapes))
        partners = [c for c in available if c.called not in alike]
        pairs += [(gain, [a, c]) for gain, c in zip(_beside(problem, a, partners), partners, strict=True)]
    pairs.sort(key=lambda item: -item[0])
    scored = [(float(held_out(problem, pair).sum()), pair) for _, pair in pairs[:BEAM]]
    if not scored:
        return []
    pair = max(scored, key=lambda item: item[0])[1]
    return sorted(pair, key=lambda c: -_gain(problem, [c]))
