"""Which of two models the episodes bear out: what is left beside one, held against what the other says otherwise.

The test is that of Davidson & MacKinnon (Econometrica 49, 1981, 781, their J test): to the worse of two models the
difference of both is added as one more column; if the better one is right, its coefficient is 1. An episode says as
much as the models differ in it, so that an effect that few presses excite is seen as well as one that all do. (Means
of differences of energy over episodes are blind to that: of 48 episodes 5 cannot reach 2.4 standard errors by them,
however clear they are.)

Where a response is fitted, models that move the pose, or remember, have it take up different functions. What the
second's may take up is taken out of the difference d first (Frisch & Waugh, Econometrica 1, 1933, 387): the residual
beside it has nothing of that over all episodes of a place, but much in each. Both differ in noise alone by
V = |(1 - P2) P1 n|^2, P1 and P2 projections on what they take up, told by draws of noise. By chance that is the mean of
the pull, too, which is taken off, and the pull has a variance that the draws tell as well (it is a quadratic form in
normal variables), beside the |d|^2 - V of what truly differs. A model's own amplitudes follow noise as well: all but
the first of those that the other has not count (the first is what a test of one column pays for; that the test rejects
too often by the others: Godfrey & Pesaran, J. Econometrics 21, 1983, 133).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.gram import summed
from tacdata.discrepancy.noise.null_model import Frame
from tacdata.discrepancy.regressors.model_error import forms
from tacdata.discrepancy.search.gauss_newton import Refined
from tacdata.discrepancy.search.screen import follows_clock
from tacdata.discrepancy.statistics.cluster_robust import Lent, clustered
from tacdata.discrepancy.statistics.gram_fit import eliminated

MOST = 3.0
"""No equation is off by more than so many of its standard deviations, however much they would explain [1]."""
TINY = 1e-6
"""Models that differ by less, over all episodes, are the same [noise scales squared]."""


@dataclass(frozen=True)
class Off:
    """What the equations of a model's effects may be off about, beside nuisances."""

    columns: np.ndarray
    """Whitened and cleaned, at one standard deviation [1], shape (m, streams, k), float32."""
    course: Course
    """Of the rows that were read."""
    frame: Frame

    @classmethod
    def of(cls, setting: Setting, model: Refined, frame: Frame, at: int | None = None) -> Off:
        """Return what a model's effect number ``at`` may be off about; all of them, unless given."""
        own = [p for k, p in enumerate(model.placed) if at is None or k == at]
        others = [p for p in model.placed if p not in own]
        columns = forms(setting.course, model.response, own, [*setting.given, *others])
        cleaner = frame.cleaner(replace(setting, response=model.response), [*setting.given, *model.placed])
        return cls(cleaner.cleaned(columns), setting.course.reduced, frame)

    def beside(self, left: np.ndarray, apart: np.ndarray) -> tuple[np.ndarray, float]:
        """Hold two whitened residuals, shape (m, streams), beside these columns.

        Returns:
            Their Gram matrix of each episode, and by how much more half the energy of the first falls than that of the
            first less the second [nats]: what both models miss is nothing to either.
        """
        both = np.concatenate([np.stack([left, apart], axis=2), self.columns], axis=2)
        gram = summed(both, self.course, self.frame.nuisances, self.frame.inner).gram
        own = self.columns.shape[2]
        ridge = np.concatenate([np.ones(own), self.frame.ridge])
        total, index = gram.sum(axis=0), np.arange(2, gram.shape[1])
        pulls = np.stack([total[index, 0], total[index, 0] - total[index, 1]])
        bare = total[np.ix_(index, index)]
        bare = bare + 1e-9 * np.eye(len(index)) * max(float(np.trace(bare)) / len(index), 1e-12)
        while np.abs(np.linalg.solve(bare + np.diag(ridge), pulls[0])[:own]).max(initial=0.0) > MOST:
            ridge[:own] *= 2
        matrix = bare + np.diag(ridge)
        falls = 0.5 * np.einsum("ki,ik->k", pulls, np.linalg.solve(matrix, pulls.T))
        fallen = max(float(falls[0] - falls[1]), 0.0)
        return eliminated(gram, index - 1, ridge)[:, :2, :2], fallen


@dataclass(frozen=True)
class Chance:
    """What noise alone makes of the difference of two models, and of how it pulls at the second."""

    apart: float
    """V, the difference squared and summed [noise scales squared]."""
    pull: float
    """Mean of the pull [1]."""
    variance: float
    """Of the pull [1]."""

    @classmethod
    def of(cls, first: Refined, second: Refined) -> Chance:
        """Return what the draws of noise say.

        V is half of |(P2 - P1) n|^2 and of what the first's response has more of freedom. Places and streams are
        nearly independent. The variance is V for responses that are much alike, and 2 V for those that have nothing in
        common.
        """
        if first.shaken is second.shaken:
            return cls(0.0, 0.0, 0.0)
        apart = second.shaken - first.shaken
        draws = apart.shape[2]
        noise = max(0.5 * (float(np.square(apart).sum()) / draws + first.freedom - second.freedom), 0.0)
        pull = np.zeros((int(first.place.max()) + 1, *apart.shape[1:]))
        np.add.at(pull, first.place, second.shaken * apart)
        groups = int(np.count_nonzero(np.any(pull, axis=2)))
        told = float(np.var(pull, axis=2, ddof=1).sum()) * (1 + 2 * np.sqrt(2 / max(groups * (draws - 1), 1)))
        return cls(noise, noise, float(np.clip(told, noise, 2 * noise)))

    def beside(self, more: int, less: int) -> Chance:
        """Return the same with amplitudes that only the first (``more``) or only the second (``less``) has."""
        return Chance(self.apart + more + less, self.pull + more, self.variance + 2 * more)

    def share(self, gram: np.ndarray) -> float:
        """Return the share of a pull that noise does not make [1]; products of episodes as in `ahead`."""
        pull, apart = float(gram[:, 0, 1].sum()), float(gram[:, 1, 1].sum())
        return max(pull - min(self.pull, apart), 0.0) / pull if pull > 0 else 1.0

    def spread(self, apart: float) -> float:
        """Return the variance of a pull over what it is where noise makes nothing, the difference squared [1]."""
        return (max(apart - self.apart, 0.0) + self.variance) / apart


def ahead(first: Refined, second: Refined, lent: dict[bool, Lent | None], off: Off | None = None) -> float:
    """Return by how many standard errors the first model is borne out against the second [1]; negative: the other way.

    Args:
        first: A model at its optimum.
        second: Another one of the same episodes, in the same frame.
        lent: What candidates say of how much scores scatter, for those that follow the clock (True) and others.
        off: What the second's equations may be off about: only what that does not explain counts against it.
    """
    more, less = _beyond(first, second), _beyond(second, first)
    loss = second.loss - first.loss - 0.5 * (more - less)
    if loss < 0:
        return -ahead(second, first, lent)
    apart = second.left - first.left
    if first.shaken is not second.shaken:
        apart = second.cleaner.projected(apart[:, :, None])[:, :, 0]
    if off is None:
        gram = np.zeros((len(first.energy), 2, 2))
        for i, values in ((0, second.left), (1, apart)):
            own = np.einsum("ij,ij->i", apart, values)
            gram[:, i, 1] = gram[:, 1, i] = np.bincount(first.episode, own, minlength=len(gram))
    else:
        gram, fallen = off.beside(second.left, apart)
        loss -= fallen
    if gram[:, 1, 1].sum() < TINY or loss <= 0:
        return 0.0
    clock = any(_differ(first, second))
    told = clustered(gram, np.zeros(1, dtype=np.int64))
    # Two models that are equally wrong pull towards each other: the better one must explain more, too.
    most = float(np.sqrt(2 * loss / max(told.power / told.expected, 1.0)))
    # Before few stretches are paid for: a large score shrinks more by that than what is sound of it.
    chance = Chance.of(first, second).beside(more, less)
    sound = replace(
        told, pull=told.pull * chance.share(gram), expected=told.expected * chance.spread(float(gram[:, 1, 1].sum()))
    )
    return min(max(sound.score(lent.get(clock)), 0.0), most)


def _beyond(model: Refined, other: Refined) -> int:
    """Return how many amplitudes, beyond the first, a model has that another has not."""
    taken = {p.effect.name for p in other.placed}
    own = [k for k in model.tangent.knobs if not k.shape and model.placed[k.at].effect.name not in taken]
    return max(len(own) - 1, 0)


def _differ(first: Refined, second: Refined) -> list[bool]:
    """Return for each effect that only one of two models has whether it follows the clock."""
    names = {p.effect.name for p in first.placed} ^ {p.effect.name for p in second.placed}
    return [follows_clock(p.effect) for p in (*first.placed, *second.placed) if p.effect.name in names]
