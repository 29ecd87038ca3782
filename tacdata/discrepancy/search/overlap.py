"""Overlap: how much of what one effect does those in the model might do in other forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem

RIDGE = 1e-6
"""Ridge of what no row excites, over the mean of what rows do [1]."""


def overlap(problem: Problem, candidates: Sequence[Candidate]) -> float:
    """Return the largest share of a candidate's columns that what is placed could explain press by press [1].

    Every press has amounts of its own of what the equations of what is placed may be off about, and of what its numbers
    move: what is left then looks like no form of it, however large that is.

    Args:
        problem: With columns for what is placed.
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
