"""The J test: which of two models that do not contain each other the episodes support.

After Davidson & MacKinnon (Econometrica 49, 1981, 781): the difference of the two predictions is added to the worse
model as one more column; if the better model is right, its coefficient is 1. The statistic is the cluster-robust score
of that column. Each episode weighs by how much the models differ in it, so few presses that excite an effect show it as
well as many. (Means over episodes of the difference in fit do not: of 48 episodes 5 cannot reach 2.4 standard errors.)

Where a response is fitted, the two models project out different functions:

- The space of the second's response is projected out of the difference d first (Frisch & Waugh, Econometrica 1,
  1933, 387). The residual has nothing of that summed over a place's episodes, but much in single ones.
- Noise n alone makes the models differ by V = |(1 - P2) P1 n|^2, P1 and P2 their projections; draws of noise estimate
  V. By chance V is the score's mean, too, and is taken off. The score's variance beyond that of the true difference,
  |d|^2 - V, is estimated by the draws (a quadratic form in normal variables).
- A model's own amplitudes follow noise as well. All that the other model has not, but the first, are paid for (that the
  test rejects too often by them: Godfrey & Pesaran, J. Econometrics 21, 1983, 133).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.gram import episode_grams
from tacdata.discrepancy.noise.null_model import NullModel
from tacdata.discrepancy.regressors.model_error import model_errors
from tacdata.discrepancy.search.gauss_newton import Refined
from tacdata.discrepancy.statistics.cluster_robust import PooledExcess, clustered_score
from tacdata.discrepancy.statistics.gram_fit import eliminated

MOST_ERROR = 3.0
"""Model error: no equation is wrong by more than so many of its standard deviations [1]."""
SAME = 1e-6
"""J test: models that differ by less, over all episodes, are the same [noise scales squared]."""
NEEDED_Z = 2.8
"""Necessity: an effect stays in the answer if the model is worse by so many standard errors without it [1]."""

Pooled = dict[bool, PooledExcess | None]
"""Shrinkage priors of effects that follow the clock (True), and of the others."""


@dataclass(frozen=True)
class ModelError:
    """Errors of a model's equations: regressors with a prior, in addition to the nuisances."""

    columns: np.ndarray
    """Whitened, at one standard deviation [1], shape (m, streams, k), float32."""
    course: Course
    """Of the rows that were read."""
    null: NullModel

    @classmethod
    def of(cls, setting: Setting, model: Refined, null: NullModel, at: int | None = None) -> ModelError:
        """Return the model error of a model's effect number ``at``; of all its effects, unless given."""
        effects = [p for k, p in enumerate(model.placed) if at is None or k == at]
        remaining = [p for p in model.placed if p not in effects]
        columns = model_errors(setting.course, model.response, effects, [*setting.given, *remaining]).values
        whitener = null.whitener_for(replace(setting, response=model.response), [*setting.given, *model.placed])
        return cls(whitener.whitened(columns), setting.course.reduced, null)

    def beside(self, residual: np.ndarray, difference: np.ndarray) -> tuple[np.ndarray, float]:
        """Eliminate these columns from a residual and a difference, shape (m, streams) each.

        Returns:
            Their Gram matrix of each episode, and by how much more half the sum of squares of the residual falls than
            that of residual less difference: an effect that both models miss counts against neither.
        """
        joined = np.concatenate([np.stack([residual, difference], axis=2), self.columns], axis=2)
        gram = episode_grams(joined, self.course, self.null.nuisances, self.null.inner).gram
        width = self.columns.shape[2]
        ridge = np.concatenate([np.ones(width), self.null.ridge])
        total, index = gram.sum(axis=0), np.arange(2, gram.shape[1])
        scores = np.stack([total[index, 0], total[index, 0] - total[index, 1]])
        bare = total[np.ix_(index, index)]
        bare = bare + 1e-9 * np.eye(len(index)) * max(float(np.trace(bare)) / len(index), 1e-12)
        # A larger coefficient is an effect, not a model error: it must remain as evidence, so the prior is tightened.
        while np.abs(np.linalg.solve(bare + np.diag(ridge), scores[0])[:width]).max(initial=0.0) > MOST_ERROR:
            ridge[:width] *= 2
        matrix = bare + np.diag(ridge)
        falls = 0.5 * np.einsum("ki,ik->k", scores, np.linalg.solve(matrix, scores.T))
        fall = max(float(falls[0] - falls[1]), 0.0)
        return eliminated(gram, index - 1, ridge)[:, :2, :2], fall


@dataclass(frozen=True)
class NoiseDifference:
    """Effect of noise alone on the difference of two models, and on its score."""

    square: float
    """V, the difference's sum of squares [noise scales squared]."""
    mean: float
    """Mean of the score [1]."""
    variance: float
    """Variance of the score [1]."""

    @classmethod
    def of(cls, first: Refined, second: Refined) -> NoiseDifference:
        """Estimate it from draws of noise.

        V is half of |(P2 - P1) n|^2 and of the first response's further degrees of freedom. Places and streams are
        nearly independent. The variance is V for responses that are almost equal, and 2 V for those that have nothing
        in common.
        """
        if first.projected_draws is second.projected_draws:
            return cls(0.0, 0.0, 0.0)
        difference = second.projected_draws - first.projected_draws
        draws = difference.shape[2]
        noise = max(0.5 * (float(np.square(difference).sum()) / draws + first.freedom - second.freedom), 0.0)
        score = np.zeros((int(first.place.max()) + 1, *difference.shape[1:]))
        np.add.at(score, first.place, second.projected_draws * difference)
        groups = int(np.count_nonzero(np.any(score, axis=2)))
        spread = float(np.var(score, axis=2, ddof=1).sum()) * (1 + 2 * np.sqrt(2 / max(groups * (draws - 1), 1)))
        return cls(noise, noise, float(np.clip(spread, noise, 2 * noise)))

    def with_amplitudes(self, more: int, less: int) -> NoiseDifference:
        """Return the same with amplitudes that only the first (``more``) or only the second (``less``) has."""
        return NoiseDifference(self.square + more + less, self.mean + more, self.variance + 2 * more)

    def share(self, gram: np.ndarray) -> float:
        """Return the share of a score that noise does not make [1]; products of episodes as in `j_statistic`."""
        score, square = float(gram[:, 0, 1].sum()), float(gram[:, 1, 1].sum())
        return max(score - min(self.mean, square), 0.0) / score if score > 0 else 1.0

    def spread(self, square: float) -> float:
        """Return the variance of a score over the difference's sum of squares, its variance without noise [1]."""
        return (max(square - self.square, 0.0) + self.variance) / square


def j_statistic(first: Refined, second: Refined, pooled: Pooled, error: ModelError | None = None) -> float:
    """Return by how many standard errors episodes support the first model [1]; negative: the second.

    Args:
        first: A model at its optimum.
        second: Another one of the same episodes, with the same null model.
        pooled: Shrinkage priors.
        error: Model error of the second: the part that it explains does not count against the second.
    """
    more, less = _further_amplitudes(first, second), _further_amplitudes(second, first)
    loss = second.loss - first.loss - 0.5 * (more - less)
    if loss < 0:
        return -j_statistic(second, first, pooled)
    difference = second.left - first.left
    if first.projected_draws is not second.projected_draws:
        difference = second.whitener.projected(difference[:, :, None])[:, :, 0]
    if error is None:
        gram = np.zeros((len(first.energy), 2, 2))
        for i, values in ((0, second.left), (1, difference)):
            products = np.einsum("ij,ij->i", difference, values)
            gram[:, i, 1] = gram[:, 1, i] = np.bincount(first.episode, products, minlength=len(gram))
    else:
        gram, fall = error.beside(second.left, difference)
        loss -= fall
    if gram[:, 1, 1].sum() < SAME or loss <= 0:
        return 0.0
    score = clustered_score(gram, np.zeros(1, dtype=np.int64))
    # Two models that are equally wrong score against each other: the better one must fit better, too.
    largest = float(np.sqrt(2 * loss / max(score.variance / score.expected_variance, 1.0)))
    # Before few clusters are paid for: a large score shrinks by more than its sound part.
    noise = NoiseDifference.of(first, second).with_amplitudes(more, less)
    sound = replace(
        score,
        total=score.total * noise.share(gram),
        expected_variance=score.expected_variance * noise.spread(float(gram[:, 1, 1].sum())),
    )
    return min(max(sound.z_score(pooled.get(_differ_by_clock(first, second))), 0.0), largest)


def necessity(setting: Setting, model: Refined, without: Refined, null: NullModel, pooled: Pooled) -> float:
    """Return by how many standard errors a model is better than one with fewer effects [1].

    The model error of the fewer effects is no evidence of others.
    """
    need = j_statistic(model, without, pooled)
    if need < NEEDED_Z or not without.placed:
        return need
    return j_statistic(model, without, pooled, ModelError.of(setting, without, null))


def _further_amplitudes(model: Refined, rival: Refined) -> int:
    """Return how many amplitudes, beyond the first, a model has that another has not."""
    shared = {p.effect.name for p in rival.placed}
    amplitudes = [k for k in model.knobs if not k.shape and model.placed[k.at].effect.name not in shared]
    return max(len(amplitudes) - 1, 0)


def _differ_by_clock(first: Refined, second: Refined) -> bool:
    """Return whether an effect that only one of two models has follows the clock."""
    names = {p.effect.name for p in first.placed} ^ {p.effect.name for p in second.placed}
    return any(p.effect.follows_clock for p in (*first.placed, *second.placed) if p.effect.name in names)
