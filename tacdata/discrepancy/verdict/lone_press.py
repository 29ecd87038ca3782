"""What a single press shows: an effect that only one press excites has no scatter over presses, and so no name.

A sandwich over few clusters of high leverage rejects too often or never (MacKinnon & Webb, J. Appl. Econometrics 32,
2017, 233). Such an effect is not tested, and told as what to repeat.
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
"""An effect is told if it explains so much of what exceeds the noise [1]."""


@dataclass(frozen=True)
class LonePress:
    """One press that holds nearly all that recordings show of an effect."""

    effect: Effect
    """What would explain most, if one press were enough."""
    share: float
    """Of what exceeds the noise, explained by it [1]."""
    episode: int
    """The press."""
    leverage: float
    """Share of the effect's information that the press holds [1]."""


def lone_press(problem: Problem) -> LonePress | None:
    """Return the effect that explains most, where one press alone shows it; None where there is no such effect."""
    bare = float(gained(problem, [], np.arange(len(problem.folds))).sum())
    excess = 0.5 * (float(problem.grams.gram[:, 0, 0].sum()) - float(problem.grams.rows.sum())) - bare
    if excess <= 0 or not problem.candidates:
        return None
    own = [gain - bare for gain in shape_gains(problem)]
    best = int(np.argmax(own))
    chosen = problem.candidates[best]
    if own[best] < MOST_OF_IT * excess:
        return None
    gram = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(0.0))
    index = chosen.columns + 1
    known = gram[:, index, index].sum(axis=1)
    held = known / max(float(known.sum()), 1e-30)
    at = int(np.argmax(held))
    if held[at] <= LARGEST_LEVERAGE:
        return None
    return LonePress(chosen.effect, min(own[best] / excess, 1.0), at, float(held[at]))
