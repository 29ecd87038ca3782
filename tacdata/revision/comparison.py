"""Compares a model with and without further effects on the same recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.noise.null_model import NullModel, null_model
from tacdata.discrepancy.search.gauss_newton import Refined, corrected, refine
from tacdata.discrepancy.verdict.sealed import without_readings
from tacdata.effects import Placed
from tacdata.revision.episodes import part

STEPS = 2
"""Gauss-Newton steps of a fit to some of the episodes, from the parameters of all of them."""


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

    @cached_property
    def values(self) -> np.ndarray:
        """Whitened values of each episode [1], shape (episodes,)."""
        rows = np.bincount(self.course.reduced.episode, minlength=self.course.episodes)
        return np.maximum(rows * Streams.of(self.course).count, 1).astype(float)

    def after(self, placed: Sequence[Placed]) -> Refined:
        """Return the model with effects of fixed parameters; a fitted response takes up the rest."""
        return refine(self.setting, placed, self.null, steps=0)

    def fitted_without(self, placed: Sequence[Placed], left_out: np.ndarray) -> tuple[Placed, ...]:
        """Return effects with parameters fitted to all episodes except some.

        The motion of the excluded episodes stays in the course, since it shaped the skin's state; only their readings
        are removed. If a place or tool occurs in no other episode, they are removed altogether.
        """
        kept = np.setdiff1d(np.arange(self.course.episodes), left_out)
        if set(self._contexts[left_out]) <= set(self._contexts[kept]):
            course = without_readings(self.course, left_out)
        else:
            course = part(self.course, kept)
        setting = Comparison(course, self.spec).setting
        rows = ~np.isin(self.course.reduced.episode, left_out)
        left = None if course.episodes == self.course.episodes else kept
        return refine(setting, placed, _frame_of(self.null, course, rows, left), STEPS).placed

    @cached_property
    def _contexts(self) -> np.ndarray:
        course = self.course
        first = np.searchsorted(course.episode, np.arange(course.episodes))
        return course.site * len(course.tools) + course.tool[first]

    def mean_square(self, model: Refined, episodes: np.ndarray) -> float:
        """Return the mean square of the whitened residual over some episodes [1]; 1 is the noise floor."""
        return float(2 * model.energy[episodes].sum() / self.values[episodes].sum())

    def predicted(self, response: Response, placed: Sequence[Placed]) -> np.ndarray:
        """Return a model's predicted readings, shape (rows, channels)."""
        return predict(self.course, response, [*self.setting.given, *placed]).signal


def _frame_of(whole: NullModel, course: Course, rows: np.ndarray, episodes: np.ndarray | None) -> NullModel:
    """Return the null model restricted to some rows.

    Their weights are still estimated from all rows; their readings are not used.

    Args:
        whole: The null model of all rows.
        course: With the rows that are kept.
        rows: Rows that are kept, shape (m,), bool.
        episodes: The remaining episodes, if they are renumbered.
    """
    return NullModel.of(
        course.reduced,
        whole.context[rows],
        None if whole.features is None else whole.features[rows],
        whole.errors[rows],
        whole.ridge,
        whole.beside[rows],
        whole.noise.of(rows, episodes),
        whole.folds,
        sizes=whole.sizes,
        spread=whole.spread,
    )
