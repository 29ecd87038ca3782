"""Score tests of every candidate, corrected for their number: which effects does the residual ask for?

Each candidate has a cluster-robust score (`tacdata.discrepancy.statistics.cluster_robust`). The p-values are those of
the largest score of all: how often do null copies of all candidates hold a larger one (the maxT procedure of Westfall &
Young, Resampling-Based Multiple Testing, 1993)? The null copies are a multiplier bootstrap: not permutations, not
knockoffs. Columns that belong to no effect are tested by flips of sign of whole episodes (a randomization test).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tacdata.discrepancy.regressors.candidates import Candidate, StandIn
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.cluster_robust import (
    ClusteredScore,
    PooledExcess,
    clustered_score,
    pooled_by_kind,
    pooled_excess,
)
from tacdata.discrepancy.statistics.gram_fit import eliminated, flips

DRAWS = 999
"""Draws of the null distribution: the least p-value is 0.001."""
PRESENT_Z = 2.0
"""Shrinkage: beyond this score a candidate may be there; the others' prior is estimated given it [1]."""
TABLE_ERROR = 0.0002
"""Numerics: an effect without memory and of a smaller share of the rise may be interpolation error of a table [1]."""
SPLINE_ERROR = 0.0005
"""Numerics: the same for columns of no effect with a fitted response, whose slope and bends are inexact [1]."""
NUMERICS_FACTOR = 3.0
"""Numerics: a candidate must explain so many times its part of the response's own error [1]."""


@dataclass(frozen=True)
class ScoreTests:
    """Scores and p-values of all candidates."""

    z: np.ndarray
    """Standard score of each candidate [1], shape (candidates,)."""
    p: np.ndarray
    """P-value of each candidate, corrected for the number of candidates [1], shape (candidates,)."""
    gain: np.ndarray
    """By how much half the whitened sum of squares falls [1], shape (candidates,)."""
    p_generic: float
    """Corrected p-value of columns that belong to no effect [1]."""
    pooled: dict[bool, PooledExcess | None]
    """Shrinkage prior of effects that follow the clock (True), and of the others."""


def score_tests(problem: Problem, seed: int = 0) -> ScoreTests:
    """Test every candidate given nuisances and the placed effects.

    Args:
        problem: The candidates' columns.
        seed: Of the null draws.
    """
    gram = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(0.0))
    normal = np.random.default_rng([seed, 13]).normal(size=(DRAWS, len(gram)))
    scores = [clustered_score(gram, c.columns) for c in problem.candidates]
    clock = [c.effect.follows_clock for c in problem.candidates]
    priors = _priors(problem, scores, "")
    z = np.array([s.z_score(priors[kind]) for s, kind in zip(scores, clock, strict=True)])
    if z.max(initial=0.0) > PRESENT_Z:
        # A true effect makes the scores of all that resemble it scatter: the prior is estimated given it.
        best = problem.candidates[int(np.argmax(z))]
        conditioned = np.concatenate([problem.fixed, best.columns]).astype(int)
        ridge = np.concatenate([problem.fixed_ridge(0.0), np.zeros(len(best.columns))])
        conditional = eliminated(problem.grams.gram, conditioned, ridge)
        priors = _priors(problem, [clustered_score(conditional, c.columns) for c in problem.candidates], best.called)
        z = np.array([s.z_score(priors[kind]) for s, kind in zip(scores, clock, strict=True)])
    # The same numbers for all candidates, so that their null scores are as correlated as they are.
    null = np.stack([s.bootstrap(normal) for s in scores], axis=1) if scores else np.zeros((DRAWS, 1))
    largest = null.max(axis=1)
    z = np.where([_numerics(problem, gram, c) for c in problem.candidates], np.minimum(z, 0.0), z)
    # Against the largest of all candidates in each draw: the correction for their number knows their correlation.
    p = (1 + (largest[:, None] >= z).sum(axis=0)) / (DRAWS + 1) if problem.setting.correct_p else ndtr(-z)
    gain = np.array([0.5 * float(np.sum(np.square(s.total))) for s in scores])
    return ScoreTests(z, p, gain, _test_generic(problem, gram, seed, largest), priors)


def _priors(problem: Problem, scores: list[ClusteredScore], left_out: str) -> dict[bool, PooledExcess | None]:
    """Return the shrinkage priors, estimated without one mechanism."""
    kinds: dict[bool, dict[str, list[ClusteredScore]]] = {False: {}, True: {}}
    for candidate, score in zip(problem.candidates, scores, strict=True):
        if candidate.called != left_out:
            kinds[candidate.effect.follows_clock].setdefault(candidate.effect.name, []).append(score)
    return pooled_by_kind(pooled_excess(kinds[False]), pooled_excess(kinds[True]))


def _numerics(problem: Problem, gram: np.ndarray, candidate: Candidate) -> bool:
    """Return whether a candidate without memory explains no more than the error of a table of solved presses."""
    setting = problem.setting
    if setting.response.fitted or candidate.effect.moves == ("tag",):
        return False
    if not candidate.effect.unjudgeable(setting.course, StandIn(True)):
        return False
    index, total = candidate.columns + 1, gram.sum(axis=0)
    smallest = max(TABLE_ERROR * problem.rise, NUMERICS_FACTOR * _along_numerics(problem, total, index))
    return _explained(total, index, 0) < smallest**2


def _along_numerics(problem: Problem, total: np.ndarray, index: np.ndarray) -> float:
    """Return how much columns explain of the response's own error [noise scales]."""
    return 0.0 if problem.numerics is None else float(np.sqrt(_explained(total, index, problem.numerics + 1)))


def _explained(total: np.ndarray, index: np.ndarray, of: int) -> float:
    """Return the squared multiple correlation of columns with one other [1]."""
    pull = total[index, of]
    return float(max(pull @ np.linalg.pinv(total[np.ix_(index, index)], hermitian=True) @ pull, 0.0))


def _test_generic(problem: Problem, gram: np.ndarray, seed: int, largest: np.ndarray) -> float:
    """Return the p-value of columns of no effect, corrected for the number of everything that is tried.

    Args:
        problem: With the columns.
        gram: Its Gram matrices, nuisances eliminated.
        seed: Of the flips.
        largest: Largest null score of all candidates in each draw, shape (draws,).
    """
    total, signs = gram.sum(axis=0), flips(len(gram), DRAWS + 1, seed)
    groups = [g for g in np.array_split(problem.generic, 6) if len(g)]
    if not groups:
        return 1.0
    table = np.stack([_flipped(gram, total, g, signs) for g in groups], axis=1)
    root = np.cbrt(np.maximum(table, 0.0))  # nearly normal (Wilson & Hilferty, PNAS 17, 1931, 684)
    z = (root - root[1:].mean(axis=0)) / (root[1:].std(axis=0) + 1e-12)
    error = SPLINE_ERROR if problem.setting.response.fitted else TABLE_ERROR
    numerics = NUMERICS_FACTOR * np.array([_along_numerics(problem, total, g + 1) for g in groups])
    beyond = 2 * (table[0] - table[1:].mean(axis=0)) > np.maximum(error * problem.rise, numerics) ** 2
    z[0] = np.where(beyond, z[0], np.minimum(z[0], 0.0))
    largest_each = np.maximum(z[1:].max(axis=1), largest)
    return float((1 + (largest_each >= z[0].max()).sum()) / (DRAWS + 1))


def _flipped(gram: np.ndarray, total: np.ndarray, columns: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return the gain of columns with whole episodes' signs flipped, shape (flips,)."""
    index = columns + 1
    matrix = total[np.ix_(index, index)]
    weight = 1e-9 * max(float(np.trace(matrix)) / len(index), 1e-12) + 1.0
    target = signs @ gram[:, index, 0]
    return 0.5 * np.einsum("fi,fi->f", target, np.linalg.solve(matrix + weight * np.eye(len(index)), target.T).T)
