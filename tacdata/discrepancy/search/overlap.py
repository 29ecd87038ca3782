"""Overlap: share of an effect that the effects in the model could explain, were their forms slightly different."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem

RIDGE = 1e-6
"""Ridge for unexcited directions, over the mean of the diagonal [1]."""


def overlap(problem: Problem, candidates: Sequence[Candidate]) -> float:
    """Return the largest share of a candidate's columns that the placed effects could explain press by press [1].

    The columns are regressed on the tangent space and the model error of the placed effects, with free coefficients
    in each press. So the unexplained part of a candidate resembles no form of the placed effects, of any size.

    Args:
        problem: Problem with columns for the placed effects.
        candidates: Shapes of one effect. Without any, the result is 0.
    """
    fixed = np.concatenate([problem.tangent.columns, problem.model_errors]).astype(int) + 1
    gram = problem.grams.gram
    if not len(fixed) or not candidates:
        return 0.0
    inner = gram[:, fixed][:, :, fixed]
    mean = np.einsum("eii->e", inner)[:, None, None] / len(fixed)
    inner = inner + (RIDGE * mean + 1e-300) * np.eye(len(fixed))
    shares = []
    for candidate in candidates:
        columns = candidate.columns + 1
        cross = gram[:, fixed][:, :, columns]
        explained = np.einsum("eik,eik->", cross, np.linalg.solve(inner, cross))
        shares.append(float(explained) / max(float(np.einsum("ekk->", gram[:, columns][:, :, columns])), 1e-300))
    return min(max(shares), 1.0)
