"""Variance components: the sizes of several kinds of episode errors, by restricted maximum likelihood (REML).

The errors e of a run of episodes tell the scores S = I e + noise of covariance I, I their joint information. Errors are
the mean of a group of episodes, which is free, and each episode's own: e = G m + u. The sizes of u are those under
which S is likeliest, all kinds and episodes at once (Patterson & Thompson, Biometrika 58, 1971, 545). Kinds that change
readings almost equal explain each other. So do episodes of one place, which share its response.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular
from scipy.optimize import minimize, root_scalar
from scipy.stats import chi2

from tacdata.discrepancy.noise.episode_gls import JointScores

FREE = 100.0
"""Prior standard deviation of a group's mean: practically free [expected size of an episode's own error]."""
SURE = 2.0
"""Sizes are expected within so many e-folds of 1: few episodes say little of them [1]."""
T_FREEDOM = 4.0
"""Degrees of freedom of the t distribution by which episodes count: a few odd ones hardly do [1]."""
ROUNDS = 20
"""Most estimates of the episodes' weights..."""
SETTLED = 0.05
"""...until none changes by more [1]."""
MOST_TOGETHER = 48
"""Most episodes that groups span: the cost grows with the cube."""
ROUNDED = 1e-6
"""Information that is less, over the largest, is rounding [1]."""
UNINFORMED = 1e-4
"""Information added to an episode's own: a direction without information is unknown, not zero [1]."""


@dataclass(frozen=True)
class Components:
    """Sizes of errors, and the errors themselves."""

    sizes: np.ndarray
    """Standard deviation of each kind [its prior's], shape (kinds,)."""
    episodes: np.ndarray
    """Numbers of the episodes, shape (n,), int64."""
    own: np.ndarray
    """Each one's own errors, as estimated without a prior [1], shape (n, kinds)."""
    unsure: np.ndarray
    """Their covariance [1], shape (n, kinds, kinds)."""
    counts: np.ndarray
    """Weight of each episode [1], shape (n,)."""


def components(runs: Sequence[JointScores], groups: Sequence[np.ndarray], lower: float, upper: float) -> Components:
    """Return the sizes of episodes' own errors.

    A few episodes unlike all others hardly count: each has a weight by how far it is off (multivariate t: Pinheiro, Liu
    & Wu, J. Comput. Graph. Stat. 10, 2001, 249). It is scaled to be consistent for normal errors.

    Args:
        runs: Runs of episodes.
        groups: Kinds of groups with a mean of their own, each as the number of the one that an episode has.
        lower: Least size.
        upper: Largest size.
    """
    runs, kinds = [_sound(run) for run in runs], runs[0].score.shape[1]
    shared = [_shared(run.episodes, groups, kinds) for run in runs]
    weights = [np.ones(len(run.episodes)) for run in runs]
    log = np.zeros(kinds)
    for _ in range(ROUNDS):
        arguments = (runs, shared, weights)
        optimum = minimize(
            _unlikely, log, arguments, method="L-BFGS-B", bounds=[(np.log(lower), np.log(upper))] * kinds
        )
        log, previous = optimum.x, weights
        posterior = [_posterior(run, mean, counts, log) for run, mean, counts in zip(*arguments, strict=True)]
        # Odd episodes count less, as in a distribution with long tails; they would enlarge the error of all others.
        weights = [_weights(errors, spread, log) for errors, spread in posterior]
        if max(np.abs(new - old).max() for new, old in zip(weights, previous, strict=True)) <= SETTLED:
            break
    results = [_alone(*entry, counts, log) for entry, counts in zip(posterior, previous, strict=True)]
    estimates, unsure = (np.concatenate([entry[k] for entry in results]) for k in (0, 1))
    return Components(
        np.exp(log), np.concatenate([run.episodes for run in runs]), estimates, unsure, np.concatenate(weights)
    )


def together(runs: Sequence[JointScores]) -> list[JointScores]:
    """Return runs laid together, `MOST_TOGETHER` episodes at most, unless one has more: groups span them."""
    packs: list[list[JointScores]] = []
    for run in runs:
        if not packs or sum(len(member.episodes) for member in packs[-1]) + len(run.episodes) > MOST_TOGETHER:
            packs.append([])
        packs[-1].append(run)
    return [
        JointScores(
            np.concatenate([run.episodes for run in pack]),
            np.concatenate([run.score for run in pack]),
            block_diag(*(run.information for run in pack)),
        )
        for pack in packs
    ]


def one_by_one(runs: Sequence[JointScores]) -> list[JointScores]:
    """Return a run for each episode, in their order: its own estimate."""
    kinds, each = runs[0].score.shape[1], []
    for run in runs:
        for k, episode in enumerate(run.episodes):
            at = slice(k * kinds, (k + 1) * kinds)
            each.append(JointScores(np.array([episode]), run.score[k : k + 1], run.information[at, at]))
    return sorted(each, key=lambda entry: int(entry.episodes[0]))


def _sound(run: JointScores) -> JointScores:
    """Return a run without information that is rounding: directions that a response absorbs are known of no episode."""
    values, vectors = np.linalg.eigh(0.5 * (run.information + run.information.T))
    significant = values > ROUNDED * max(float(values[-1]), 1e-300)
    inside = vectors[:, significant]
    score = inside @ (inside.T @ run.score.ravel())
    return replace(run, score=score.reshape(run.score.shape), information=(inside * values[significant]) @ inside.T)


def _shared(episodes: np.ndarray, groups: Sequence[np.ndarray], kinds: int) -> np.ndarray:
    """Return the prior covariance of the groups' means, as episodes have them, shape (n kinds, n kinds)."""
    same = np.sum([group[episodes][:, None] == group[episodes] for group in groups], axis=0)
    return np.kron(FREE**2 * same, np.eye(kinds))


def _covariance(shared: np.ndarray, weights: np.ndarray, log: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the prior variance of episodes' own errors, shape (n kinds,), and the covariance of all."""
    variances = (np.exp(2 * log) / weights[:, None]).ravel()
    return variances, shared + np.diag(variances)


def _unlikely(
    log: np.ndarray, runs: Sequence[JointScores], shared: list[np.ndarray], weights: list[np.ndarray]
) -> float:
    """Return the negative logarithm of how likely sizes are, given as logarithms."""
    # A prior of one on the sizes: with few episodes the likelihood alone would end at zero.
    cost = 0.5 * float(np.sum(np.square(log / SURE)))
    for run, mean, counts in zip(runs, shared, weights, strict=True):
        # det(1 + L'IL) instead of det(I): the information I is zero along directions that the response absorbs.
        root = cholesky(_covariance(mean, counts, log)[1], lower=True, check_finite=False)
        factor = cholesky(np.eye(len(root)) + root.T @ run.information @ root, lower=True, check_finite=False)
        whitened = solve_triangular(factor, root.T @ run.score.ravel(), lower=True, check_finite=False)
        cost += float(np.log(np.diag(factor)).sum()) - 0.5 * float(whitened @ whitened)
    return cost


def _posterior(
    run: JointScores, mean: np.ndarray, counts: np.ndarray, log: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes' own errors, shape (n, kinds), and the covariance of each one's, shape (n, kinds, kinds)."""
    count, kinds = run.score.shape
    variances, covariance = _covariance(mean, counts, log)
    inner = np.linalg.inv(np.eye(len(covariance)) + run.information @ covariance)
    errors = variances * (inner @ run.score.ravel())
    spread = np.diag(variances) - variances[:, None] * (inner @ run.information) * variances
    blocks = spread.reshape(count, kinds, count, kinds)[np.arange(count), :, np.arange(count)]
    return errors.reshape(count, kinds), blocks


def _weights(errors: np.ndarray, spread: np.ndarray, log: np.ndarray) -> np.ndarray:
    """Return the weight of each episode, shape (n,)."""
    kinds = errors.shape[1]
    power = np.sum((np.square(errors) + np.diagonal(spread, axis1=1, axis2=2)) / np.exp(2 * log), axis=1)
    return (T_FREEDOM + kinds) / (T_FREEDOM * _consistent(kinds) + power)


def _alone(
    errors: np.ndarray, spread: np.ndarray, counts: np.ndarray, log: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and their covariance without the expectation of an episode's own."""
    kinds = errors.shape[1]
    inverse = np.linalg.inv(0.5 * (spread + np.swapaxes(spread, 1, 2)))
    prior = counts[:, None, None] * np.diag(np.exp(-2 * log))
    # Precisions of independent sources add: without that of the prior, that of the readings is left.
    unsure = np.linalg.inv(_positive(inverse - prior) + UNINFORMED * np.eye(kinds))
    return np.einsum("ekl,elm,em->ek", unsure, inverse, errors), unsure


def _positive(matrices: np.ndarray) -> np.ndarray:
    """Return symmetric matrices (n, k, k) with negative eigenvalues set to 0."""
    values, vectors = np.linalg.eigh(0.5 * (matrices + np.swapaxes(matrices, 1, 2)))
    return (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)


@cache
def _consistent(kinds: int) -> float:
    """Return the factor of the t distribution's scale that is consistent for normal numbers [1]."""
    # A mean over equally probable quantiles is the expectation over the distribution.
    at = chi2.ppf((np.arange(4000) + 0.5) / 4000, kinds)

    def bias(scale: float) -> float:
        return float(np.mean((T_FREEDOM + kinds) * at / (T_FREEDOM * scale + at))) - kinds

    return float(root_scalar(bias, bracket=(0.1, 20.0)).root)
