"""Sufficient statistics: one Gram matrix an episode of residual and columns, as generalized least squares sees them.

To first order the measured streams of an episode are y = f + A theta + B beta + Z z + e:

- f the model's prediction, A theta the contribution of effects,
- B beta the response's own degrees of freedom (splines of a fitted response, constant offsets): projected out,
- Z z the episode's own errors, with a prior,
- e autocorrelated noise: an AR(1) filter and each stream's scale whiten it.

Every later fit, fold, bootstrap and flip of sign is a small matrix problem in these Gram matrices.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.statistics.gram_fit import Beside


@dataclass(frozen=True)
class EpisodeGrams:
    """Gram matrices of the residual (first) and the columns, episode by episode."""

    gram: np.ndarray
    """Products of whitened columns [1], shape (episodes, 1 + columns, 1 + columns); entry 0 is the residual."""
    rows: np.ndarray
    """Whitened values behind each episode [1], shape (episodes,)."""
    _sums: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False, compare=False)
    _beside: dict[tuple[bytes, ...], Beside] = field(default_factory=dict, repr=False, compare=False)

    def of(self, episodes: np.ndarray) -> np.ndarray:
        """Return the summed Gram matrix of some episodes."""
        key = np.asarray(episodes).tobytes()
        if key not in self._sums:
            self._sums[key] = self.gram[episodes].sum(axis=0)
        return self._sums[key]

    def beside(self, columns: np.ndarray, ridge: np.ndarray, episodes: np.ndarray) -> Beside:
        """Return the same given columns that are free of bounds, fitted to some episodes."""
        key = (columns.tobytes(), ridge.tobytes(), np.asarray(episodes).tobytes())
        if key not in self._beside:
            self._beside[key] = Beside(self.gram, self.of(episodes), columns, ridge)
        return self._beside[key]


def episode_grams(
    columns: np.ndarray, course: Course, extra: np.ndarray | None = None, inner: np.ndarray | None = None
) -> EpisodeGrams:
    """Return the `Evidence` of columns that are cleaned.

    Args:
        columns: Shape (n, streams, k).
        course: Whose rows.
        extra: Further columns, cleaned before, shape (n, streams, more).
        inner: Their own Gram matrices, shape (episodes, more, more).
    """
    width, more = columns.shape[2], 0 if extra is None else extra.shape[2]
    # One matrix an episode: all later fits, folds and flips of signs work on these and not on rows.
    gram, rows = np.zeros((course.episodes, width + more, width + more)), np.zeros(course.episodes)
    edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
    for number, (begin, end) in enumerate(pairwise(edges)):
        values = (end - begin) * columns.shape[1]
        flat = columns[begin:end].reshape(values, width)
        gram[number, :width, :width], rows[number] = flat.T @ flat, flat.shape[0]
        if extra is not None and inner is not None:
            cross = flat.T @ extra[begin:end].reshape(values, more)
            gram[number, :width, width:], gram[number, width:, :width], gram[number, width:, width:] = (
                cross,
                cross.T,
                inner[number],
            )
    return EpisodeGrams(gram, rows)
