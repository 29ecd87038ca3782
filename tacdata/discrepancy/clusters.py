"""How far a candidate's score is off chance, told from how the episodes' own scores scatter.

The score of an episode is what its residual says of a candidate's amplitudes. What is left of it beside the candidate's
own fit scatters as the noise does, whatever memory or tails that has, and however large the effect is. Episodes of
large leverage count as if they were left out (HC3: MacKinnon & White, J. Econometrics 29, 1985, 305), successive ones
that have something in common are taken together (cluster-robust), and the few that remain are paid for by an F
distribution with the degrees of freedom of their leverage (after Bell & McCaffrey, Survey Methodology 28, 2002, 169).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc, ndtri

EACH = 5
"""Successive episodes that are taken together where they have something in common [1]."""
FEWEST, MOST = 10, 24
"""Least (if there are so many episodes) and most stretches."""
ALIKE = 1.64
"""Successive episodes have something in common beyond so many standard errors of their correlation [1]..."""
CLOCKWISE = 0.0
"""...for candidates that follow the clock, beyond so many."""
LEVERAGE = 0.6
"""A candidate of which one stretch holds a larger share of all information is not judged [1]."""
FLOOR = 1e-300


@dataclass(frozen=True)
class Clustered:
    """One candidate's score, in units in which its amplitudes' errors are alike."""

    pull: np.ndarray
    """Sum of the episodes' scores [1], shape (k,)."""
    scatter: np.ndarray
    """What each stretch's score is off what the fit says [1], shape (stretches, k)."""
    of: np.ndarray
    """Stretch of each episode, shape (episodes,), int64."""
    freedom: tuple[float, float]
    """Degrees of freedom of the statistic: of the pull, of the scatter [1]."""

    @property
    def power(self) -> float:
        """Mean square of the pull by chance [1]."""
        return max(float(np.sum(np.square(self.scatter))), 1e-12)

    def score(self) -> float:
        """Return the standard normal score of the pull [1]."""
        return float(_normal(np.array([np.sum(np.square(self.pull)) / self.power]), *self.freedom)[0])

    def by_chance(self, signs: np.ndarray) -> np.ndarray:
        """Return the scores that flips of stretches give [1], shape (flips,).

        Args:
            signs: Of each stretch's number, at least as many as there are, shape (flips, stretches or more).
        """
        pulls = signs[:, : len(self.scatter)] @ self.scatter
        return _normal(np.sum(np.square(pulls), axis=1) / self.power, self.freedom[0], 1e6)


def clustered(gram: np.ndarray, columns: np.ndarray, clock: bool) -> Clustered:
    """Return a candidate's score.

    Args:
        gram: One Gram matrix an episode, residual first, nuisances eliminated, shape (episodes, 1 + p, 1 + p).
        columns: The candidate's, counted from 0 without the residual, shape (k,).
        clock: Whether it is told from how episodes follow each other.
    """
    index = columns + 1
    information = gram[:, index][:, :, index]
    total = information.sum(axis=0)
    kept = np.diag(total) > 1e-9 * max(float(np.diag(total).max(initial=0.0)), 1e-12)
    index, information, total = index[kept], information[:, kept][:, :, kept], total[np.ix_(kept, kept)]
    if not len(index):
        return _nothing(len(gram))
    scores = gram[:, index, 0]
    turned = _unit(total)
    white = scores @ turned.T
    pull = white.sum(axis=0)
    inside = np.einsum("ji,eik,lk->ejl", turned, information, turned, optimize=True)
    bare = white - inside @ pull
    leverage = np.einsum("ejj->ej", inside)
    of = np.arange(len(gram))
    if _alike(bare, leverage, CLOCKWISE if clock else ALIKE):
        count = int(np.clip(len(gram) // EACH, min(FEWEST, len(gram)), MOST))
        of = of * count // len(gram)
    together = np.zeros((of.max() + 1, len(index)))
    heavy = np.zeros_like(together)
    np.add.at(together, of, bare)
    np.add.at(heavy, of, leverage)
    told = heavy.max(axis=0) <= LEVERAGE
    if not told.any():
        return _nothing(len(gram))
    scatter = together[:, told] / (1 - heavy[:, told])
    return Clustered(pull[told], scatter, of, _freedom(scatter, heavy[:, told]))


def _nothing(episodes: int) -> Clustered:
    return Clustered(np.zeros(1), np.ones((1, 1)), np.zeros(episodes, dtype=int), (1.0, 1.0))


def _unit(total: np.ndarray) -> np.ndarray:
    """Return the matrix that makes the information a unit matrix; directions that nothing excites become 0."""
    values, vectors = np.linalg.eigh(total)
    good = values > 1e-7 * values[-1]
    return (vectors[:, good] / np.sqrt(values[good])) @ vectors[:, good].T


def _alike(bare: np.ndarray, leverage: np.ndarray, beyond: float) -> bool:
    sized = bare / np.sqrt(np.maximum(leverage, 1e-9))
    sized = np.where(leverage > 0.05 * np.median(leverage), sized, 0.0)
    power = np.sum(np.square(sized), axis=0)
    common = float(np.sum(sized[1:] * sized[:-1])) / max(float(power.sum()), 1e-12)
    freedom = float(power.sum()) ** 2 / max(float(np.sum(power**2)), 1e-12)
    # An episode's own mean taken off makes successive ones differ by 1/n on average.
    return (common + 1 / len(bare)) * np.sqrt(len(bare) * freedom) > beyond


def _freedom(scatter: np.ndarray, heavy: np.ndarray) -> tuple[float, float]:
    product = scatter @ scatter.T
    own = max(float(np.trace(product)) ** 2 / max(float(np.sum(product**2)), 1e-300), 1.0)
    share = heavy.sum(axis=1) / max(float(heavy.sum()), 1e-12)
    count = 1 / float(np.sum(share**2))
    return own, max(own * (count - 1), 1.0)


def _normal(ratio: np.ndarray, first: float, second: float) -> np.ndarray:
    return -ndtri(np.clip(fdtrc(first, second, np.maximum(ratio, 0.0)), FLOOR, 1 - 1e-12))
