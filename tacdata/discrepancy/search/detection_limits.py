"""Detection limits: the size of each effect at which it would be found about half the time."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated

FOUND_Z = 4.0
"""Standard errors over episodes at which an effect is found about half the time (50 % power) [1]."""


def detection_limits(problem: Problem) -> dict[str, float]:
    """Return for each effect the size at which it would be found about half the time, in typical sizes.

    The error of an amplitude is cluster-robust: it is estimated from how the episodes' scores scatter. Of several
    shapes or directions the easiest counts. inf: these episodes do not excite it.
    """
    fixed, ridge = problem.fixed, problem.fixed_ridge(0.0)
    gram = eliminated(problem.grams.gram, fixed, ridge)
    total = gram.sum(axis=0)
    result: dict[str, float] = {}
    for candidate in problem.candidates:
        for column in candidate.columns + 1:
            information = float(total[column, column])
            scores = gram[:, column, 0]
            # No smaller than noise of known size makes it: few episodes scatter less by chance.
            spread = max(float(np.sqrt(np.sum(np.square(scores)))), float(np.sqrt(max(information, 0.0))))
            limit = FOUND_Z * spread / information if information > 1e-9 else np.inf
            name = candidate.effect.name
            result[name] = min(result.get(name, np.inf), limit)
    return result
