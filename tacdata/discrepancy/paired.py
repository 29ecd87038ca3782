"""Which of two models the episodes bear out: what is left beside one, held against what the other says otherwise.

The test is that of Davidson & MacKinnon (Econometrica 49, 1981, 781, their J test): to the worse of two models the
difference of both is added as one more column; if the better one is right, its coefficient is 1. An episode says as
much as the models differ in it, so that an effect that few presses excite is seen as well as one that all do. (Means
of differences of energy over episodes are blind to that: of 48 episodes 5 cannot reach 2.4 standard errors by them,
however clear they are.)
"""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.clusters import Lent, clustered
from tacdata.discrepancy.refine import Refined
from tacdata.discrepancy.search import follows_clock

TINY = 1e-6
"""Models that differ by less, over all episodes, are the same [noise scales squared]."""


def ahead(first: Refined, second: Refined, lent: dict[bool, Lent | None]) -> float:
    """Return by how many standard errors the first model is borne out against the second [1]; negative: the other way.

    Args:
        first: A model at its optimum.
        second: Another one of the same episodes, in the same frame.
        lent: What candidates say of how much scores scatter, for those that follow the clock (True) and others.
    """
    if first.energy.sum() > second.energy.sum():
        return -ahead(second, first, lent)
    apart = second.left - first.left
    episodes = len(first.energy)
    own = np.bincount(first.episode, np.einsum("ij,ij->i", apart, apart), minlength=episodes)
    if own.sum() < TINY:
        return 0.0
    pull = np.bincount(first.episode, np.einsum("ij,ij->i", apart, second.left), minlength=episodes)
    gram = np.zeros((episodes, 2, 2))
    gram[:, 0, 1] = gram[:, 1, 0] = pull
    gram[:, 1, 1] = own
    clock = any(_differ(first, second))
    told = clustered(gram, np.zeros(1, dtype=np.int64), clock)
    loss = float((second.energy - first.energy).sum())
    # Two models that are equally wrong pull towards each other: the better one must explain more, too.
    most = float(np.sqrt(2 * loss / max(told.power / told.expected, 1.0)))
    return min(max(told.score(lent.get(clock)), 0.0), most)


def _differ(first: Refined, second: Refined) -> list[bool]:
    """Return for each effect that only one of two models has whether it follows the clock."""
    names = {p.effect.name for p in first.placed} ^ {p.effect.name for p in second.placed}
    return [follows_clock(p.effect) for p in (*first.placed, *second.placed) if p.effect.name in names]
