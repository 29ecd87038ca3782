"""How far a candidate's score is off chance, told from how the episodes' own scores scatter.

The score of an episode is what its residual says of a candidate's amplitudes. What is left of it beside the candidate's
own fit scatters as the noise does, whatever memory or tails that has, and however large the effect is. Episodes of
large leverage count as if they were left out (HC3: MacKinnon & White, J. Econometrics 29, 1985, 305), successive ones
that have something in common are taken together (cluster-robust), and the few that remain are paid for by an F
distribution with the degrees of freedom of their leverage (after Bell & McCaffrey, Survey Methodology 28, 2002, 169).
How much a score scatters, against what the noise makes, is told from few episodes where few excite a candidate; all
candidates of a kind lend each other what they have in common (empirical Bayes: Smyth, Stat. Appl. Genet. Mol. Biol. 3,
2004, article 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import digamma, fdtrc, ndtri, polygamma

EACH = 5
"""Successive episodes that are taken together where they have something in common [1]."""
FEWEST, MOST = 10, 24
"""Least (if there are so many episodes) and most stretches."""
ALIKE = 1.64
"""Successive episodes have something in common beyond so many standard errors of their correlation [1]."""
LEVERAGE = 0.6
"""A candidate of which one stretch holds a larger share of all information is not judged [1]."""
FLOOR = 1e-300
LENT = 0.5
"""Most degrees of freedom that effects lend each other, of their number: many look alike [1]."""
LEAST = 1.0
"""Least excess that is lent: nothing scatters less than the noise makes, but by chance, or as noise was told too large
[1]."""
UNLIKE = 0.05
"""One that scatters more than so many of its kind would by chance is lent the less, the fewer would [1]."""
LENDERS = 5
"""Fewer effects of a kind lend nothing [1]."""


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
    expected: float = 1.0
    """What `power` is if nothing but the noise shakes [1]."""
    drawn: float = 1.0
    """Degrees of freedom of what `by_chance` draws: no more than the stretches at hand span [1]."""

    @property
    def power(self) -> float:
        """Mean square of the pull by chance, as these episodes scatter [1]."""
        return max(float(np.sum(np.square(self.scatter))), 1e-12)

    def score(self, lent: Lent | None = None) -> float:
        """Return the standard normal score of the pull [1], with what other candidates lend."""
        power, (first, second) = self.power, self.freedom
        if lent is not None:
            more = lent.freedom * self._of_a_kind(lent)
            power = (second * power + more * lent.excess * self.expected) / (second + more)
            second = second + more
        return float(_normal(np.array([np.sum(np.square(self.pull)) / power]), first, second)[0])

    def _of_a_kind(self, lent: Lent) -> float:
        """Return how much of what others lend applies [1]: little to one that scatters far more than they do.

        (Robust empirical Bayes: Phipson et al., Ann. Appl. Stat. 10, 2016, 946.)
        """
        ratio = self.power / max(lent.excess * self.expected, 1e-12)
        return float(min(fdtrc(self.freedom[1], max(lent.freedom, 1.0), ratio) / UNLIKE, 1.0))

    def by_chance(self, normal: np.ndarray) -> np.ndarray:
        """Return the scores that scatter alone gives, shape (draws,).

        Every stretch's say is multiplied by a normal number, which keeps what candidates have in common and stays
        right for few stretches, where signs do not (Chernozhukov, Chetverikov & Kato, Ann. Stat. 41, 2013, 2786).

        Args:
            normal: Of each stretch's number, at least as many as there are, shape (draws, stretches or more).
        """
        pulls = normal[:, : len(self.scatter)] @ self.scatter
        return _normal(np.sum(np.square(pulls), axis=1) / self.power, self.drawn, 1e6)


@dataclass(frozen=True)
class Lent:
    """What all candidates of a kind say of how much scores scatter."""

    excess: float
    """Square of the scatter over what the noise makes [1]."""
    freedom: float
    """Degrees of freedom that this is worth [1]."""


def lent(effects: dict[str, list[Clustered]]) -> Lent | None:
    """Return what effects of a kind have in common; None if they are too few to say.

    By medians, so that a few that miss what is there do not count.

    Args:
        effects: Each with the scores of its shapes, which are much alike.
    """
    told = [[s for s in shapes if np.any(s.pull)] for shapes in effects.values()]
    told = [shapes for shapes in told if shapes]
    if len(told) < LENDERS:
        return None
    half = 0.5 * np.array([np.median([s.freedom[1] for s in shapes]) for shapes in told])
    excess = [np.median([s.power / max(s.expected, 1e-12) for s in shapes]) for shapes in told]
    log = np.log(excess) - digamma(half) + np.log(half)
    middle = float(np.median(log))
    spread = float(1.4826 * np.median(np.abs(log - middle))) ** 2 - float(np.mean(polygamma(1, half)))
    freedom = min(2 * _trigamma_inverse(spread), LENT * len(told)) if spread > 0 else LENT * len(told)
    return Lent(max(float(np.exp(middle + digamma(freedom / 2) - np.log(freedom / 2))), LEAST), freedom)


def of_kinds(others: Lent | None, clock: Lent | None) -> dict[bool, Lent | None]:
    """Return what effects that follow the clock (True), and others, are lent.

    Few effects follow the clock, and lend each other little. Where they scatter no more than all others do, the larger
    excess of those counts, and all that they know; where something wanders, only their own.
    """
    if others is not None and clock is not None and others.excess >= clock.excess:
        clock = others
    return {False: others, True: clock}


def _trigamma_inverse(value: float) -> float:
    """Return x with trigamma(x) = value > 0, by Newton's method on its inverse (Smyth 2004, appendix)."""
    x = 0.5 + 1 / value
    for _ in range(30):
        now = float(polygamma(1, x))
        step = now * (1 - now / value) / float(polygamma(2, x))
        x = max(x + step, 1e-3)
        if abs(step) < 1e-8 * x:
            break
    return x


def clustered(gram: np.ndarray, columns: np.ndarray) -> Clustered:
    """Return a candidate's score.

    Args:
        gram: One Gram matrix an episode, residual first, nuisances eliminated, shape (episodes, 1 + p, 1 + p).
        columns: The candidate's, counted from 0 without the residual, shape (k,).
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
    if _alike(bare, leverage):
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
    expected = float(np.sum(heavy[:, told] / (1 - heavy[:, told])))
    own, freedom = _freedom(scatter, heavy[:, told])
    return Clustered(pull[told], scatter, of, freedom, expected, own)


def _nothing(episodes: int) -> Clustered:
    return Clustered(np.zeros(1), np.ones((1, 1)), np.zeros(episodes, dtype=int), (1.0, 1.0))


def _unit(total: np.ndarray) -> np.ndarray:
    """Return the matrix that makes the information a unit matrix; directions that nothing excites become 0."""
    values, vectors = np.linalg.eigh(total)
    good = values > 1e-7 * values[-1]
    return (vectors[:, good] / np.sqrt(values[good])) @ vectors[:, good].T


def _alike(bare: np.ndarray, leverage: np.ndarray) -> bool:
    sized = bare / np.sqrt(np.maximum(leverage, 1e-9))
    sized = np.where(leverage > 0.05 * np.median(leverage), sized, 0.0)
    power = np.sum(np.square(sized), axis=0)
    common = float(np.sum(sized[1:] * sized[:-1])) / max(float(power.sum()), 1e-12)
    freedom = float(power.sum()) ** 2 / max(float(np.sum(power**2)), 1e-12)
    # An episode's own mean taken off makes successive ones differ by 1/n on average.
    return (common + 1 / len(bare)) * np.sqrt(len(bare) * freedom) > ALIKE


def _freedom(scatter: np.ndarray, heavy: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Return the degrees of freedom that the scatter spans, and those of the pull and of its power.

    Few stretches span fewer directions than the pull has: the participation ratio (tr C)^2 / tr C^2 of the amplitudes'
    covariance C is told without that bias, as tr C^2 from n equal stretches is too large by (tr C)^2 / n.
    """
    product = scatter @ scatter.T
    whole, square = float(np.trace(product)) ** 2, max(float(np.sum(product**2)), FLOOR)
    share = heavy.sum(axis=1) / max(float(heavy.sum()), 1e-12)
    together = float(np.sum(share**2))
    least = whole / scatter.shape[1]
    own = whole / max((square - together * whole) / (1 + together), least, FLOOR)
    own = max(own, 1.0)
    return max(whole / square, 1.0), (own, max(own * (1 / together - 1), 1.0))


def _normal(ratio: np.ndarray, first: float, second: float) -> np.ndarray:
    return -ndtri(np.clip(fdtrc(first, second, np.maximum(ratio, 0.0)), FLOOR, 1 - 1e-12))
