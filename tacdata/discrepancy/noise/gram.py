"""Sufficient statistics: what every episode says of every column, with nuisances and noise taken out.

The measured streams y of an episode are, to first order, y = f + A theta + B beta + Z z + e: f the model's prediction,
A what effects would add at their typical size, B what the response itself may still take up (splines of a fitted
response; constant offsets), z the episode's own error of depth with a prior, e coloured noise. Rows are whitened by an
AR(1) filter and each stream's scale, B is projected out exactly, z by ridge. What is left is kept as one Gram matrix
an episode, so that every fit, fold, bootstrap and sign flip afterwards is a small matrix problem.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise.offset_process import OffsetProcess


@dataclass(frozen=True)
class Noise:
    """How readings scatter around the truth."""

    scale: np.ndarray
    """Standard deviation of the innovations [each stream's unit], shape (streams,)."""
    memory: float
    """Correlation of successive rows at the median step [1]."""
    offsets: OffsetProcess | None = None
    """How episodes' offsets go on from one to the next; None leaves each free."""
    gain_error: np.ndarray | None = None
    """What one standard deviation of an episode's own gain of a stream changes [its unit], shape (n, streams)."""
    missing: np.ndarray | None = None
    """Which values were not read, shape (n, streams), bool; None: all were."""
    random_walk: np.ndarray | None = None
    """What one standard deviation of each mode of a stream's wander within an episode changes [noise scales], shape
    (n, modes); None: it does not wander there."""
    relative_scale: np.ndarray | None = None
    """How much larger noise is in each value than without load [1], shape (n, streams); None: it is not."""
    tag: float | None = None
    """Standard deviation of an episode's own offset of the tag's streams (the last three), in noise scales [1]; they
    have a free offset for each place and know nothing of the response. None: there is no tag."""

    def of(self, rows: np.ndarray, episodes: np.ndarray | None = None) -> Noise:
        """Return the noise of some rows, shape (n,), bool; ``episodes`` are those left, if they are numbered anew."""
        each = {name: getattr(self, name) for name in ("gain_error", "missing", "random_walk", "relative_scale")}
        kept = {name: None if value is None else value[rows] for name, value in each.items()}
        return replace(self, **kept, offsets=None if self.offsets is None else self.offsets.of(rows, episodes))


@dataclass(frozen=True)
class EpisodeGrams:
    """Gram matrices of the residual (first) and the columns, episode by episode."""

    gram: np.ndarray
    """Products of whitened columns [1], shape (episodes, 1 + columns, 1 + columns); entry 0 is the residual."""
    rows: np.ndarray
    """Whitened values behind each episode [1], shape (episodes,)."""
    _sums: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    def of(self, episodes: np.ndarray) -> np.ndarray:
        """Return the summed Gram matrix of some episodes."""
        key = np.asarray(episodes).tobytes()
        if key not in self._sums:
            self._sums[key] = self.gram[episodes].sum(axis=0)
        return self._sums[key]


def whiten(values: np.ndarray, course: Course, noise: Noise, rows: np.ndarray | None = None) -> np.ndarray:
    """Divide by the relative scale, filter by e_i - phi^(dt / median dt) e_{i-1} within episodes, divide by the scale.

    Args:
        values: Shape (n, streams, columns).
        course: Whose rows.
        noise: Scales and memory.
        rows: Rows of the course, of whole episodes, that ``values`` are of; all, unless given.
    """
    some = slice(None) if rows is None else rows
    decay, spread = _filter(course, noise)
    decay, spread = decay[some], spread[some]
    if noise.relative_scale is None:
        result = values.astype(np.float32)
    else:
        result = values.astype(np.float32, copy=False) / noise.relative_scale[some][:, :, None]
    if noise.missing is not None:
        missing = noise.missing[some]
        result[missing] = 0.0
        result[1:] -= decay[1:, None, None].astype(np.float32) * result[:-1]
        gone = missing.copy()
        gone[1:] |= missing[:-1] & ~course.first[some][1:, None]
        result[gone] = 0.0
    else:
        result[1:] -= decay[1:, None, None].astype(np.float32) * result[:-1]
    result /= (spread[:, None] * noise.scale[None]).astype(np.float32)[:, :, None]
    return result


def _filter(course: Course, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Return how much of the reading before each row keeps [1], and its innovation over the scale [1], shape (n,)."""
    inside = course.step[~course.first]
    median = float(np.median(inside)) if len(inside) else 1.0
    decay = noise.memory ** np.clip(course.step / max(median, 1e-9), 0.0, 50.0)
    decay = np.where(course.first, 0.0, decay)
    spread = np.sqrt(np.maximum(1 - decay**2, 1e-6) / max(1 - noise.memory**2, 1e-6))
    return decay, spread / np.sqrt(np.minimum(course.averaged, 4.0))


def episode_grams(
    columns: np.ndarray, course: Course, beside: np.ndarray | None = None, inner: np.ndarray | None = None
) -> EpisodeGrams:  # fmt: skip
    """Return the `Evidence` of columns that are cleaned.

    Args:
        columns: Shape (n, streams, k).
        course: Whose rows.
        beside: Further columns, cleaned before, shape (n, streams, more).
        inner: Their own Gram matrices, shape (episodes, more, more).
    """
    few, more = columns.shape[2], 0 if beside is None else beside.shape[2]
    gram, rows = np.zeros((course.episodes, few + more, few + more)), np.zeros(course.episodes)
    edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
    for number, (begin, end) in enumerate(pairwise(edges)):
        values = (end - begin) * columns.shape[1]
        flat = columns[begin:end].reshape(values, few)
        gram[number, :few, :few], rows[number] = flat.T @ flat, flat.shape[0]
        if beside is not None and inner is not None:
            both = flat.T @ beside[begin:end].reshape(values, more)
            gram[number, :few, few:], gram[number, few:, :few], gram[number, few:, few:] = both, both.T, inner[number]
    return EpisodeGrams(gram, rows)
