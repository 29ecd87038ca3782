"""Fits of candidates to the Gram matrices of all presses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import solve


def fitted(problem: Problem, chosen: Sequence[Candidate]) -> np.ndarray:
    """Return the coefficients of some candidates, then those of placed effects, model errors and nuisances."""
    return _fit(problem, chosen)[0]


def best_shapes(problem: Problem) -> dict[str, Candidate]:
    """Return each effect's candidate that lowers the sum of squares most, in a fit with its bounds."""
    best: dict[str, tuple[float, Candidate]] = {}
    for candidate in problem.candidates:
        gain, name = _fit(problem, [candidate])[1], candidate.effect.name
        if name not in best or gain > best[name][0]:
            best[name] = gain, candidate
    return {name: candidate for name, (_, candidate) in best.items()}


def _fit(problem: Problem, chosen: Sequence[Candidate]) -> tuple[np.ndarray, float]:
    """Return coefficients, and by how much they lower half the sum of squares [1]."""
    moving, own = problem.tangent.columns, [c.columns for c in chosen]
    rooms = np.array([k.room(problem.placed) for k in problem.tangent.knobs]).reshape(-1, 2)
    fixed = len(problem.model_errors) + len(problem.nuisances)
    free, count = np.full(fixed, np.inf), sum(map(len, own))
    columns = np.concatenate([*own, moving, problem.model_errors, problem.nuisances]).astype(int)
    low = np.concatenate([np.minimum(np.concatenate([*(c.low for c in chosen), rooms[:, 0]]), -1e-12), -free])
    high = np.concatenate([np.maximum(np.concatenate([*(c.high for c in chosen), rooms[:, 1]]), 1e-12), free])
    ridge = np.concatenate(
        [np.full(count, 1e-6), np.ones(len(moving)), np.ones(len(problem.model_errors)), problem.ridge]
    )
    total = problem.grams.gram.sum(axis=0)
    values, index = solve(total, columns, ridge, low, high), columns + 1
    return values, float(total[0, index] @ values - 0.5 * values @ total[np.ix_(index, index)] @ values)
