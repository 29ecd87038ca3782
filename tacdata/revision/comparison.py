"""Compares a model with and without further effects on the same recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.noise.null_model import NullModel, null_model
from tacdata.discrepancy.search.gauss_newton import Refined, corrected, refine
from tacdata.discrepancy.verdict.sealed import without_readings
from tacdata.effects import Placed
from tacdata.revision.episodes import part

STEPS = 2
"""Gauss-Newton steps of a fit to some of the episodes, from the parameters of all of them."""
LEAST_WHITE = 0.02
"""Least share of a reading's variance that is not predicted by the reading before [1]."""


@dataclass(frozen=True)
class Comparison:
    """Recordings, and the model that is compared with them."""

    course: Course
    spec: Spec
    answer: tuple[Placed, ...] = ()
    """Effects that are in the model while the noise is estimated; a missing large effect would count as noise."""

    @cached_property
    def setting(self) -> Setting:
        """The model without further effects."""
        return Setting(self.course, self.spec.response(self.course), [], self.spec.nuisance, self.spec.effects())

    @cached_property
    def null(self) -> NullModel:
        """Noise and nuisance parameters, the same before and after."""
        response = corrected(self.setting, self.answer)
        return null_model(replace(self.setting, response=response, given=(*self.setting.given, *self.answer)))

    @cached_property
    def before(self) -> Refined:
        """The model without further effects."""
        return refine(self.setting, [], self.null)

    @property
    def noise(self) -> np.ndarray:
        """Standard deviation of a reading's noise [the source's unit], shape (channels,)."""
        noise = self.null.noise
        return noise.scale[: self.course.channels] / np.sqrt(max(1 - noise.memory**2, LEAST_WHITE))

    def after(self, placed: Sequence[Placed]) -> Refined:
        """Return the model with effects of fixed parameters; a fitted response takes up the remainder."""
        return refine(self.setting, placed, self.null, steps=0)

    def without(self, episodes: np.ndarray) -> Comparison:
        """Return the comparison without the readings of some episodes; their motion stays, as it shaped the skin."""
        return Comparison(without_readings(self.course, episodes), self.spec, self.answer)

    def covered(self, episodes: np.ndarray) -> bool:
        """Return whether the other episodes hold every place and tool of some episodes."""
        remainder = np.setdiff1d(np.arange(self.course.episodes), episodes)
        return set(self._contexts[episodes]) <= set(self._contexts[remainder])

    def fitted_without(self, placed: Sequence[Placed], episodes: np.ndarray) -> tuple[Placed, ...]:
        """Return effects with parameters fitted to all episodes except some.

        If a place or tool occurs in no other episode, the episodes are removed altogether.
        """
        remainder = np.setdiff1d(np.arange(self.course.episodes), episodes)
        covered = self.covered(episodes)
        course = without_readings(self.course, episodes) if covered else part(self.course, remainder)
        setting = Comparison(course, self.spec).setting
        # The noise is that of all rows; of these the fit keeps the others.
        rows = ~np.isin(self.course.reduced.episode, episodes)
        return refine(setting, placed, _frame_of(self.null, course, rows, None if covered else remainder), STEPS).placed

    @cached_property
    def _contexts(self) -> np.ndarray:
        course = self.course
        first = np.searchsorted(course.episode, np.arange(course.episodes))
        # One number for each pair of place and tool.
        return course.site * len(course.tools) + course.tool[first]

    def predicted(self, response: Response, placed: Sequence[Placed]) -> np.ndarray:
        """Return a model's predicted readings, shape (rows, channels)."""
        return predict(self.course, response, [*self.setting.given, *placed]).signal

    def squares(self, model: Refined, scale: np.ndarray) -> np.ndarray:
        """Return squared residuals over the noise, each episode's median subtracted [1], shape (m, channels).

        Args:
            model: A response with its effects.
            scale: Noise of a reading [the source's unit], shape (channels,).
        """
        course = self.course.reduced
        # The whole course is predicted, as memory needs every row; the read ones are compared.
        residual = (course.readings - self.predicted(model.response, model.placed)[self.course.read]) / scale
        for number in np.unique(course.episode):
            rows = course.episode == number
            readable = np.isfinite(residual[rows]).any(axis=0)
            residual[np.ix_(rows, readable)] -= np.nanmedian(residual[rows][:, readable], axis=0)
        return np.square(residual)

    def mean_squares(self, model: Refined, episodes: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Return the mean of `squares` over each of some episodes [1], shape (k,)."""
        squares, number = self.squares(model, scale), self.course.reduced.episode
        return np.array([float(np.nanmean(squares[number == e])) for e in episodes])


def _frame_of(null: NullModel, course: Course, rows: np.ndarray, episodes: np.ndarray | None) -> NullModel:
    """Return the null model restricted to some rows.

    Their weights are still estimated from all rows; their readings are not used.

    Args:
        null: The null model of all rows.
        course: With the rows that are kept.
        rows: Rows that are kept, shape (m,), bool.
        episodes: The remaining episodes, if they are renumbered.
    """
    return NullModel.of(
        course.reduced,
        null.context[rows],
        None if null.features is None else null.features[rows],
        null.errors[rows],
        null.ridge,
        null.beside[rows],
        null.noise.of(rows, episodes),
        null.folds,
        sizes=null.sizes,
        spread=null.spread,
    )
