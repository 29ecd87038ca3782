"""Effects that only one press excites: without scatter over presses there is no standard error, and so no name.

A sandwich over few clusters of high leverage rejects too often or never (MacKinnon & Webb, J. Appl. Econometrics 32,
2017, 233). Such an effect is not tested; the verdict recommends to repeat the press.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.search.fits import gained, shape_gains
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.cluster_robust import LARGEST_LEVERAGE
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.effects import Effect

MOST_OF_IT = 0.5
"""Least share of the residual above the noise that a reported effect explains [1]."""


@dataclass(frozen=True)
class LonePress:
    """One press with nearly all information of the recordings on an effect."""

    effect: Effect
    """The candidate that explains most."""
    share: float
    """Part of the residual above the noise that it explains [1]."""
    episode: int
    """The press."""
    leverage: float
    """Share of the effect's information that the press holds [1]."""


def lone_press(problem: Problem) -> LonePress | None:
    """Return the effect that explains most if one press has nearly all information on it; else None."""
    bare = float(gained(problem, [], np.arange(len(problem.folds))).sum())
    excess = 0.5 * (float(problem.grams.gram[:, 0, 0].sum()) - float(problem.grams.rows.sum())) - bare
    if excess <= 0 or not problem.candidates:
        return None
    gains = [gain - bare for gain in shape_gains(problem)]
    best = int(np.argmax(gains))
    candidate = problem.candidates[best]
    if gains[best] < MOST_OF_IT * excess:
        return None
    gram = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(0.0))
    index = candidate.columns + 1
    information = gram[:, index, index].sum(axis=1)
    shares = information / max(float(information.sum()), 1e-30)
    at = int(np.argmax(shares))
    if shares[at] <= LARGEST_LEVERAGE:
        return None
    return LonePress(candidate.effect, min(gains[best] / excess, 1.0), at, float(shares[at]))
