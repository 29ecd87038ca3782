"""Overlap: share of one effect that those in the model might explain in other forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem

RIDGE = 1e-6
"""Ridge of unexcited directions, over the mean of the excited ones [1]."""


def overlap(problem: Problem, candidates: Sequence[Candidate]) -> float:
    """Return the largest share of a candidate's columns that the placed effects could explain press by press [1].

    Every press has amounts of its own of the placed effects' model error, and of their tangent space:
    the remainder then resembles no form of them, however large they are.

    Args:
        problem: With columns for the placed effects.
        candidates: Shapes of an effect; 0 without any.
    """
    beside = np.concatenate([problem.tangent.columns, problem.model_errors]).astype(int) + 1
    gram = problem.grams.gram
    if not len(beside) or not candidates:
        return 0.0
    inner = gram[:, beside][:, :, beside]
    mean = np.einsum("eii->e", inner)[:, None, None] / len(beside)
    inner = inner + (RIDGE * mean + 1e-300) * np.eye(len(beside))
    shares = []
    for candidate in candidates:
        own = candidate.columns + 1
        across = gram[:, beside][:, :, own]
        explained = np.einsum("eik,eik->", across, np.linalg.solve(inner, across))
        shares.append(float(explained) / max(float(np.einsum("ekk->", gram[:, own][:, :, own])), 1e-300))
    return min(max(shares), 1.0)
