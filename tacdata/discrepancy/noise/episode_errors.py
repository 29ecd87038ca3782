"""Sizes of episode errors, and noise, estimated from the residual of an over-rich fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise import offset_random_walk, readings
from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.offset_process import offset_process
from tacdata.discrepancy.noise.repeats import repeats
from tacdata.discrepancy.noise.variance_components import components, one_by_one, together
from tacdata.discrepancy.noise.whitener import Whitener
from tacdata.discrepancy.statistics.gram_fit import solve

LEAST_SIZE, MOST_SIZE = 0.1, 10.0
"""Bounds of the estimated size of pose errors [standard deviations of their prior]."""
TOGETHER = 4
"""Successive episodes that share a mean where places are not visited again."""
LEAST_SCALE = 1e-5
"""Least noise of a stream [its largest rise]: readings without noise carry rounding, which is no evidence."""
ODD_Z = 6.0
"""An episode is odd if its errors exceed the estimated spread by so many standard deviations [1]."""


@dataclass(frozen=True)
class ErrorSizes:
    """How far episodes err by themselves."""

    sizes: np.ndarray
    """Standard deviation of each kind of error [its prior's], shape (kinds,)."""
    odd: np.ndarray
    """Episodes that err by far more than the others, shape (k,), int64."""
    counts: np.ndarray
    """Weight of each episode among the others of its place [1], shape (episodes,)."""


@dataclass(frozen=True)
class EpisodeErrors:
    """Estimates episode errors from a residual, given columns that any response may need."""

    residual: np.ndarray
    """Measured less predicted [each stream's unit], shape (m, streams); NaN where missing."""
    rich: np.ndarray
    """Columns that belong to no effect [each stream's unit], shape (m, streams, k)."""
    course: Course
    """Of the rows read."""
    context: np.ndarray
    """Group of rows that share features, shape (m,), int64."""
    features: np.ndarray | None
    """Degrees of freedom of the response [1], shape (m, k)."""
    rise: np.ndarray
    """Rise of each stream under presses [its unit], shape (m, streams)."""

    def noise(self, errors: np.ndarray) -> Noise:
        """Return the noise besides errors of pose, shape (m, streams, kinds)."""
        course, relative = self.course, readings.relative_scale(self.residual, self.rise, self.course)
        residual = readings.beside_depth(self.residual, course)
        least = LEAST_SCALE * np.abs(self.rise).max(axis=0)
        estimate = _at_least(readings.first_guess(residual, course, relative), least)
        columns = np.concatenate([residual[:, :, None], self.rich], axis=2, dtype=np.float32)
        best = np.zeros(self.rich.shape[2])
        # Noise and the over-rich fit depend on each other; a second turn changes little afterwards.
        for _ in range(2):
            best = self._best(columns, Whitener(course, estimate, self.context, self.features, errors))
            standardized = (residual - self.rich @ best.astype(np.float32)) / estimate.scale
            still = readings.still(estimate, standardized.shape[1])
            whitener = Whitener(course, still, self.context, self.features, errors / estimate.scale[None, :, None])
            bare = whitener.whitened(standardized[:, :, None])[:, :, 0]
            bare[~np.isfinite(residual)] = np.nan
            estimate = _at_least(readings.refined(bare * estimate.scale, course, estimate), least)
        remainder = residual - self.rich @ best.astype(np.float32)
        kinds = levels(course, self.context, self.features is not None)
        process = offset_process(remainder, course, estimate.scale, estimate.memory, kinds)
        rate = offset_random_walk.walk_rate(remainder, course, estimate.scale, estimate.memory, self._repeats)
        walk = offset_random_walk.modes(rate, course, estimate.memory)
        tag = readings.tag_offset_spread(remainder, course, estimate)
        return replace(estimate, offsets=process, random_walk=walk, walk_rate=rate, tag=tag)

    def left(self, noise: Noise, errors: np.ndarray, counts: np.ndarray | None = None) -> np.ndarray:
        """Return the residual of an over-rich fit, shape (m, streams), float32.

        Its weights hardly depend on the sizes of the errors fitted with it: one fit serves all their estimates.

        Args:
            noise: Noise.
            errors: Of pose, shape (m, streams, kinds).
            counts: Weight of each episode, shape (episodes,); equal, unless given.
        """
        columns = np.concatenate([self.residual[:, :, None], self.rich], axis=2, dtype=np.float32)
        best = self._best(columns, Whitener(self.course, noise, self.context, self.features, errors), counts)
        return (self.residual - self.rich @ best.astype(np.float32)).astype(np.float32)

    def poses(self, noise: Noise, errors: np.ndarray, residual: np.ndarray) -> ErrorSizes:
        """Return the estimated size of episodes' own errors of pose.

        A difference that depends on place, depth, rate or session is no error of an episode's own: those that repeat
        one another have a mean of their own. Where places are not visited again, a few successive episodes have one.

        Args:
            noise: Noise, with the errors of an episode's gains.
            errors: Effect of errors of one standard deviation of their prior, shape (m, streams, kinds).
            residual: Residual of an over-rich fit, shape (m, streams).
        """
        course, kinds, place = self.course, errors.shape[2], self._places()
        plain = Whitener(course, noise, self.context, self.features, np.zeros_like(errors[:, :, :1]))
        scores = plain.joint_scores(residual, errors)
        episodes = np.sort(np.concatenate([run.episodes for run in scores]))
        groups, places = [self._repeats, course.session], [place, course.session]
        if _freedom(episodes, groups) < readings.FEWEST_GAPS:
            number = np.zeros(course.episodes, dtype=np.int64)
            number[episodes] = np.arange(len(episodes)) // TOGETHER
            scores, groups, places = one_by_one(scores), [number], [number]
        counts = np.ones(course.episodes)
        if _freedom(episodes, groups) < readings.FEWEST_GAPS:
            return ErrorSizes(np.ones(kinds), np.zeros(0, dtype=np.int64), counts)
        scores = together(scores)
        estimated = components(scores, groups, LEAST_SIZE, MOST_SIZE).sizes
        # Few repeat one another: an odd episode among them makes the size that hides it. A place has more.
        each = components(scores, places, LEAST_SIZE, MOST_SIZE)
        spread = each.unsure + np.diag(np.square(np.minimum(estimated, each.sizes)))
        far = np.einsum("ek,ek->e", each.own, np.linalg.solve(spread, each.own[:, :, None])[:, :, 0])
        counts[each.episodes] = each.counts
        return ErrorSizes(estimated, np.sort(each.episodes[far > ODD_Z**2]), counts)

    def gains(self, noise: Noise, errors: np.ndarray, residual: np.ndarray) -> float:
        """Return how far an episode's gain of a stream is off the next one's that repeats it [1].

        Args:
            noise: Noise without own gains.
            errors: Of pose, shape (m, streams, kinds).
            residual: Residual of an over-rich fit, shape (m, streams).
        """
        whitener = Whitener(self.course, noise, self.context, self.features, errors)
        score, information = whitener.stream_scores(residual, self.rise)
        return readings.gain_spread(score, information, self._repeats)

    @cached_property
    def _repeats(self) -> np.ndarray:
        return repeats(self.course, self._places())

    def _places(self) -> np.ndarray:
        place = np.zeros(self.course.episodes, dtype=np.int64)
        place[self.course.episode] = self.context
        return place

    def _best(self, columns: np.ndarray, whitener: Whitener, counts: np.ndarray | None = None) -> np.ndarray:
        """Return the weights of the over-rich columns that fit best, shape (k,)."""
        count = self.rich.shape[2]
        each = whitener.episode_grams(columns).gram
        gram = each.sum(axis=0) if counts is None else np.einsum("e,eij->ij", counts, each)
        bounds = np.full(count, np.inf)
        return solve(gram, np.arange(count), np.ones(count), -bounds, bounds)


def levels(course: Course, context: np.ndarray, fitted: bool) -> list[np.ndarray]:
    """Return the kinds of levels that offsets have, each as a number an episode, shape (episodes,).

    A session has a level of its own; where the response is fitted, each of its places has one too.
    """
    place = np.zeros(course.episodes, dtype=np.int64)
    place[course.episode] = context
    return [course.session, place] if fitted else [course.session]


def _at_least(noise: Noise, least: np.ndarray) -> Noise:
    """Return noise with a scale of each stream that is no smaller than a bound, shape (streams,)."""
    return replace(noise, scale=np.maximum(noise.scale, least))


def _freedom(episodes: np.ndarray, groups: list[np.ndarray]) -> int:
    """Return how many episodes there are beyond the means of their groups."""
    means = np.concatenate([group[episodes, None] == np.unique(group[episodes]) for group in groups], axis=1)
    return len(episodes) - int(np.linalg.matrix_rank(means.astype(float)))
