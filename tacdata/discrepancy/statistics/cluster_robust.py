"""Cluster-robust score tests: is a regressor's score beyond chance, given how episodes scatter?

The score of an episode is the inner product of its residual with the regressor, after generalized least squares.
Its variance is estimated by a sandwich over episodes, which holds whatever the noise within an episode is:

- HC3: each episode's score is that given a fit without it (MacKinnon & White, J. Econometrics 29, 1985, 305).
- Clusters: where successive episodes correlate, runs of them count as one.
- Small samples: an F distribution with the degrees of freedom that the leverages leave (Bell & McCaffrey, Survey
  Methodology 28, 2002, 169).
- Shrinkage: few episodes estimate a variance badly. All regressors of a kind share one prior for the ratio of the
  variance to the one that the noise model expects (empirical Bayes: Smyth, Stat. Appl. Genet. Mol. Biol. 3, 2004, 3).
- Null distribution: a multiplier bootstrap, the same for all regressors (`ClusteredScore.bootstrap`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import digamma, fdtrc, ndtri, polygamma

CLUSTER_SIZES = (1, 2, 3, 5)
"""Clusters: successive episodes in one cluster, as many as it takes for clusters not to correlate [episodes]."""
FEWEST_CLUSTERS, MOST_CLUSTERS = 10, 24
"""Clusters: bounds of the number of the largest ones; few leave no degrees of freedom, many are correlated again."""
CORRELATED_Z = 1.64
"""Clusters: episodes are joined if lag-1 correlation exceeds so many standard errors (5 %, one-sided) [1]."""
LARGEST_LEVERAGE = 0.6
"""HC3: an amplitude of which one cluster holds a larger share of the information is not tested [1]."""
FLOOR = 1e-300
PRIOR_FREEDOM = 2.0
"""Shrinkage: most prior degrees of freedom, over the number of effects: fewer show as a spread of their ratios [1]."""
INDEPENDENT = 0.5
"""Shrinkage: share of the effects that are independent of one another; many are collinear [1]."""
LEAST_EXCESS = 1.0
"""Shrinkage: least prior excess. Less than the noise expects is chance, or an overestimated noise [1]."""
SURELY = 1.0
"""Shrinkage: ratios spread by more than chance beyond so many standard errors of that [1]."""
CLOCK_Z = 2.0
"""Shrinkage: effects that follow the clock scatter more beyond so many standard errors of the two ratios [1]."""
OUTLIER_P = 0.05
"""Shrinkage: an effect whose variance is less probable than this under the prior is shrunk the less [1]."""
FEWEST_POOLED = 5
"""Shrinkage: fewer effects of a kind estimate no prior."""


@dataclass(frozen=True)
class ClusteredScore:
    """A candidate's score in coordinates in which its information is the unit matrix."""

    total: np.ndarray
    """Sum of the episodes' scores [1], shape (k,)."""
    residuals: np.ndarray
    """HC3 residual of each cluster's score [1], shape (clusters, k)."""
    cluster: np.ndarray
    """Cluster of each episode, shape (episodes,), int64."""
    freedom: tuple[float, float]
    """Degrees of freedom of the F statistic: numerator, denominator [1]."""
    expected_variance: float = 1.0
    """`variance` under the noise model [1]."""
    bootstrap_freedom: float = 1.0
    """Degrees of freedom of the draws of `bootstrap`: at most those that the clusters span [1]."""

    @property
    def variance(self) -> float:
        """Sandwich estimate of the total's variance, summed over amplitudes [1]."""
        return max(float(np.sum(np.square(self.residuals))), 1e-12)

    def z_score(self, pooled: PooledExcess | None = None) -> float:
        """Return the F statistic as a standard normal score [1], its variance shrunk towards a prior if given."""
        variance, (first, second) = self.variance, self.freedom
        if pooled is not None:
            expected, more = pooled.excess * self.expected_variance, pooled.freedom * self._prior_weight(pooled)
            sample_part, prior = second * variance / (second + more), more * expected / (second + more)
            variance, second = sample_part + prior, second + more
            # The prior's covariance is a multiple of the unit matrix: all amplitudes are degrees of freedom.
            square = sample_part**2 / first + (2 * sample_part + prior) * prior / self.residuals.shape[1]
            first = variance**2 / square
        return float(_normal(np.array([np.sum(np.square(self.total)) / variance]), first, second)[0])

    def _prior_weight(self, pooled: PooledExcess) -> float:
        """Return the weight of the prior [1], little for an outlier of its kind.

        Robust empirical Bayes: Phipson et al., Ann. Appl. Stat. 10, 2016, 946.
        """
        ratio = self.variance / max(pooled.excess * self.expected_variance, 1e-12)
        return float(min(fdtrc(self.freedom[1], max(pooled.freedom, 1.0), ratio) / OUTLIER_P, 1.0))

    def bootstrap(self, normal: np.ndarray) -> np.ndarray:
        """Return scores under the null by the multiplier bootstrap, shape (draws,).

        Each cluster's residual is multiplied by a normal number. Regressors that share the numbers keep their
        correlation. It holds for few clusters, where flips of sign do not (Chernozhukov, Chetverikov & Kato, Ann. Stat.
        41, 2013, 2786).

        Args:
            normal: A number for each cluster, shape (draws, clusters or more).
        """
        totals = normal[:, : len(self.residuals)] @ self.residuals
        return _normal(np.sum(np.square(totals), axis=1) / self.variance, self.bootstrap_freedom, 1e6)


@dataclass(frozen=True)
class PooledExcess:
    """Prior for the ratio of a score's variance to the expected one, from all candidates of a kind (shrinkage)."""

    excess: float
    """Prior ratio [1]."""
    freedom: float
    """Prior degrees of freedom [1]."""
    error: float = 0.0
    """Standard error of the ratio's natural logarithm [1]."""


def pooled_excess(effects: dict[str, list[ClusteredScore]]) -> PooledExcess | None:
    """Return the prior of a kind; None if it has too few effects.

    Estimated by medians: the few effects that resemble a missing one do not count.

    Args:
        effects: Effect -> scores of its shapes, which are nearly collinear.
    """
    excited = [[s for s in shapes if np.any(s.total)] for shapes in effects.values()]
    excited = [shapes for shapes in excited if shapes]
    if len(excited) < FEWEST_POOLED:
        return None
    half = 0.5 * np.array([np.median([s.freedom[1] for s in shapes]) for shapes in excited])
    excess = [np.median([s.variance / max(s.expected_variance, 1e-12) for s in shapes]) for shapes in excited]
    # The log of a chi-squared variable over its freedom has mean digamma(half) - log(half), variance trigamma(half)
    # (Smyth 2004).
    log = np.log(excess) - digamma(half) + np.log(half)
    middle = float(np.median(log))
    chance, independent = float(np.mean(polygamma(1, half))), INDEPENDENT * len(excited)
    # A spread of ratios is one beyond its standard error under chance.
    spread = float(1.4826 * np.median(np.abs(log - middle))) ** 2 - chance * (1 + SURELY * np.sqrt(2 / independent))
    limit = PRIOR_FREEDOM * len(excited)
    freedom = min(2 * _trigamma_inverse(spread), limit) if spread > 0 else limit
    ratio = float(np.exp(middle + digamma(freedom / 2) - np.log(freedom / 2)))
    # A median's standard error is sqrt(pi / 2) = 1.2533 times a mean's.
    return PooledExcess(max(ratio, LEAST_EXCESS), freedom, 1.2533 * float(np.sqrt(chance / independent)))


def pooled_by_kind(general: PooledExcess | None, clock: PooledExcess | None) -> dict[bool, PooledExcess | None]:
    """Return the priors of effects that follow the clock (True) and of all others (False).

    Few effects follow the clock, and estimate a prior badly. They get that of the others. Where something drifts, they
    surely scatter more, and keep their own.
    """
    if general is not None and clock is not None:
        surely = float(np.log(clock.excess / general.excess)) > CLOCK_Z * np.hypot(clock.error, general.error)
        clock = clock if surely else general
    return {False: general, True: clock}


def _trigamma_inverse(value: float) -> float:
    """Return x with trigamma(x) = value > 0, by Newton's method on its inverse (Smyth 2004, appendix)."""
    x = 0.5 + 1 / value
    for _ in range(30):
        current = float(polygamma(1, x))
        step = current * (1 - current / value) / float(polygamma(2, x))
        x = max(x + step, 1e-3)
        if abs(step) < 1e-8 * x:
            break
    return x


def clustered_score(gram: np.ndarray, columns: np.ndarray) -> ClusteredScore:
    """Return a candidate's cluster-robust score.

    Args:
        gram: One Gram matrix an episode, residual first, nuisances eliminated, shape (episodes, 1 + p, 1 + p).
        columns: The candidate's, counted from 0 without the residual, shape (k,).
    """
    index = columns + 1
    information = gram[:, index][:, :, index]
    total = information.sum(axis=0)
    excited = np.diag(total) > 1e-9 * max(float(np.diag(total).max(initial=0.0)), 1e-12)
    index, information, total = index[excited], information[:, excited][:, :, excited], total[np.ix_(excited, excited)]
    if not len(index):
        return _nothing(len(gram))
    scores = gram[:, index, 0]
    root = _unit(total)
    white = scores @ root.T
    sum_score = white.sum(axis=0)
    inside = np.einsum("ji,eik,lk->ejl", root, information, root, optimize=True)
    bare = white - inside @ sum_score
    leverage = np.einsum("ejj->ej", inside)
    # A drift makes successive presses dependent. They are joined into larger clusters until their scores no longer
    # correlate: the sandwich assumes independent clusters.
    for size in CLUSTER_SIZES:
        count = max(len(gram) // size, min(FEWEST_CLUSTERS, len(gram)))
        if size == CLUSTER_SIZES[-1]:
            count = min(count, MOST_CLUSTERS)
        cluster = np.arange(len(gram)) * count // len(gram)
        together, heavy = np.zeros((2, count, len(index)))
        np.add.at(together, cluster, bare)
        np.add.at(heavy, cluster, leverage)
        if not _correlated(together, heavy):
            break
    tested = heavy.max(axis=0) <= LARGEST_LEVERAGE
    if not tested.any():
        return _nothing(len(gram))
    # HC3: the division undoes the pull of a cluster on the fit that it is compared with (decision 0008).
    residuals = together[:, tested] / (1 - heavy[:, tested])
    expected = float(np.sum(heavy[:, tested] / (1 - heavy[:, tested])))
    drawn, freedom = _freedom(residuals, heavy[:, tested])
    return ClusteredScore(sum_score[tested], residuals, cluster, freedom, expected, drawn)


def _nothing(episodes: int) -> ClusteredScore:
    return ClusteredScore(np.zeros(1), np.ones((1, 1)), np.zeros(episodes, dtype=int), (1.0, 1.0))


def _unit(total: np.ndarray) -> np.ndarray:
    """Return the matrix that makes the information a unit matrix; directions that nothing excites become 0."""
    values, vectors = np.linalg.eigh(total)
    good = values > 1e-7 * values[-1]
    return (vectors[:, good] / np.sqrt(values[good])) @ vectors[:, good].T


def _correlated(bare: np.ndarray, leverage: np.ndarray) -> bool:
    """Return whether the residual scores of successive episodes correlate."""
    sized = bare / np.sqrt(np.maximum(leverage, 1e-9))
    sized = np.where(leverage > 0.05 * np.median(leverage), sized, 0.0)
    power = np.sum(np.square(sized), axis=0)
    common = float(np.sum(sized[1:] * sized[:-1])) / max(float(power.sum()), 1e-12)
    freedom = float(power.sum()) ** 2 / max(float(np.sum(power**2)), 1e-12)
    # An episode's own mean taken off makes successive ones differ by 1/n on average.
    return (common + 1 / len(bare)) * np.sqrt(len(bare) * freedom) > CORRELATED_Z


def _freedom(residuals: np.ndarray, heavy: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Return the degrees of freedom that the clusters span, and those of the F statistic.

    The numerator's is the participation ratio (tr C)^2 / tr C^2 of the amplitudes' covariance C. From n equal clusters
    tr C^2 is too large by (tr C)^2 / n, which is taken off.
    """
    product = residuals @ residuals.T
    trace_square, square = float(np.trace(product)) ** 2, max(float(np.sum(product**2)), FLOOR)
    share = heavy.sum(axis=1) / max(float(heavy.sum()), 1e-12)
    together = float(np.sum(share**2))
    lowest = trace_square / residuals.shape[1]
    degrees = trace_square / max((square - together * trace_square) / (1 + together), lowest, FLOOR)
    degrees = max(degrees, 1.0)
    return max(trace_square / square, 1.0), (degrees, max(degrees * (1 / together - 1), 1.0))


def _normal(ratio: np.ndarray, first: float, second: float) -> np.ndarray:
    """Return F statistics as standard normal scores."""
    return -ndtri(np.clip(fdtrc(first, second, np.maximum(ratio, 0.0)), FLOOR, 1 - 1e-12))
