"""Sufficient statistics: what every episode says of every column, with nuisances and noise taken out.

The measured streams y of an episode are, to first order, y = f + A theta + B beta + Z z + e: f the model's prediction,
A what effects would add at their typical size, B what the response itself may still take up (splines of a fitted
response; constant offsets), z the episode's own error of depth with a prior, e coloured noise. Rows are whitened by an
AR(1) filter and each stream's scale, B is projected out exactly, z by ridge. What is left is kept as one Gram matrix
an episode, so that every fit, fold, bootstrap and sign flip afterwards is a small matrix problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tacdata.chain import Course


@dataclass(frozen=True)
class Noise:
    """How readings scatter around the truth."""

    scale: np.ndarray
    """Standard deviation of the innovations [each stream's unit], shape (streams,)."""
    memory: float
    """Correlation of successive rows at the median step [1]."""
    offset: float
    """Standard deviation of an episode's own offset, in noise scales [1]; inf leaves it free."""
    swing: np.ndarray | None = None
    """What one standard deviation of an episode's own gain of a stream changes [its unit], shape (n, streams)."""
    missing: np.ndarray | None = None
    """Which values were not read, shape (n, streams), bool; None: all were."""
    tag: float | None = None
    """Standard deviation of an episode's own offset of the tag's streams (the last three), in noise scales [1]; they
    have a free offset for each place and know nothing of the response. None: there is no tag."""


@dataclass(frozen=True)
class Evidence:
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


def whiten(values: np.ndarray, course: Course, noise: Noise) -> np.ndarray:
    """Filter by e_i - phi^(dt / median dt) e_{i-1} within episodes and divide by the innovations' scale.

    Args:
        values: Shape (n, streams, columns).
        course: Whose rows.
        noise: Scales and memory.
    """
    inside = course.step[~course.first]
    median = float(np.median(inside)) if len(inside) else 1.0
    decay = noise.memory ** np.clip(course.step / max(median, 1e-9), 0.0, 50.0)
    decay = np.where(course.first, 0.0, decay)
    result = values.astype(np.float32)
    if noise.missing is not None:
        result[noise.missing] = 0.0
        before = result[:-1].copy()
        result[1:] -= decay[1:, None, None].astype(np.float32) * before
        gone = noise.missing.copy()
        gone[1:] |= noise.missing[:-1] & ~course.first[1:, None]
        result[gone] = 0.0
    else:
        result[1:] -= decay[1:, None, None].astype(np.float32) * values[:-1].astype(np.float32)
    spread = np.sqrt(np.maximum(1 - decay**2, 1e-6) / max(1 - noise.memory**2, 1e-6))
    spread = spread / np.sqrt(np.minimum(course.averaged, 4.0))
    result /= spread[:, None, None].astype(np.float32)
    result /= noise.scale[None, :, None].astype(np.float32)
    return result


def collect(
    columns: np.ndarray, course: Course, noise: Noise, context: np.ndarray, features: np.ndarray | None,
    jitter: np.ndarray, beside: np.ndarray | None = None,
) -> Evidence:  # fmt: skip
    """Reduce columns to `Evidence`.

    Args:
        columns: Residual first, then effects, shape (n, streams, 1 + columns).
        course: Whose rows.
        noise: Noise model.
        context: Group of rows that share features, shape (n,); an episode lies in one.
        features: What the response may take up, shape (n, k); None for nothing but offsets.
        jitter: What an episode's own errors of pose of one standard deviation change, shape (n, streams, kinds).
        beside: Further columns, cleaned before (`cleaned`), shape (n, streams, more).
    """
    width = columns.shape[2] + (0 if beside is None else beside.shape[2])
    gram = np.zeros((course.episodes, width, width))
    rows = np.zeros(course.episodes)
    for group, part in _cleaned(columns, course, noise, context, features, jitter):
        whole = part if beside is None else np.concatenate([part, beside[group]], axis=2)
        for number in np.unique(course.episode[group]):
            flat = whole[course.episode[group] == number].reshape(-1, width)
            gram[number] = flat.T @ flat
            rows[number] = flat.shape[0]
    return Evidence(gram, rows)


def cleaned(
    columns: np.ndarray, course: Course, noise: Noise, context: np.ndarray, features: np.ndarray | None,
    jitter: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return columns whitened and without nuisances, shape (n, streams, columns). Arguments as of `collect`."""
    result = np.zeros(columns.shape, dtype=np.float32)
    for group, part in _cleaned(columns, course, noise, context, features, jitter):
        result[group] = part
    return result


def leftover(
    column: np.ndarray, course: Course, noise: Noise, context: np.ndarray, features: np.ndarray | None,
    jitter: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return one column whitened and without nuisances, shape (n, streams). Arguments as of `collect`."""
    return cleaned(column[:, :, None], course, noise, context, features, jitter)[:, :, 0]


def _cleaned(
    columns: np.ndarray, course: Course, noise: Noise, context: np.ndarray, features: np.ndarray | None,
    jitter: np.ndarray,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:  # fmt: skip
    white = whiten(columns, course, noise)
    flat = Noise(np.ones(1), noise.memory, noise.offset)
    shared = None if features is None else whiten(features[:, None, :], course, flat)[:, 0]
    offset = whiten(np.ones((course.rows, 1, 1)), course, flat)[:, 0]
    moved = whiten(jitter, course, noise)
    swung = None if noise.swing is None else whiten(noise.swing[:, :, None], course, noise)[:, :, 0]
    order = np.argsort(context, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(context[order])) + 1):
        swing = None if swung is None else swung[group]
        yield (
            group,
            _project(white[group], moved[group], course.episode[group], offset[group], shared, group, noise, swing),
        )


def _project(
    white: np.ndarray, moved: np.ndarray, episode: np.ndarray, offset: np.ndarray, shared: np.ndarray | None,
    group: np.ndarray, noise: Noise, swing: np.ndarray | None,
) -> np.ndarray:  # fmt: skip
    """Return one group's columns without what features, offsets and errors of pose explain."""
    numbers, local = np.unique(episode, return_inverse=True)
    own = np.zeros((len(white), len(numbers)), dtype=np.float32)
    own[np.arange(len(white)), local] = offset[:, 0]
    design = own if shared is None else np.column_stack([own, shared[group]])
    used = np.abs(design).max(axis=0) > 1e-9
    prior = 0.0 if np.isinf(noise.offset) else noise.offset**-2
    ridge = np.where(np.arange(design.shape[1]) < len(numbers), prior, 0.0)[used]
    seen = white.shape[1] - (3 if noise.tag is not None else 0)
    order = np.argsort(local, kind="stable")
    spans = np.split(order, np.flatnonzero(np.diff(local[order])) + 1)
    group_of = _Group(design[:, used], ridge, spans)
    result = np.empty_like(white)
    result[:, :seen] = group_of.left(white[:, :seen], moved[:, :seen], None if swing is None else swing[:, :seen])
    if seen < white.shape[1]:
        result[:, seen:] = _without_offsets(white[:, seen:], own, noise)
    return result


class _Group:
    """Rows of one place: a projection C = 1 - D K D' shared by all streams, and episodes' own columns T beside it.

    T is only ever seen through D'T and sums over an episode's rows: its columns are as many as episodes.
    """

    def __init__(self, design: np.ndarray, ridge: np.ndarray, spans: list[np.ndarray]) -> None:
        """Prepare the projection.

        Args:
            design: D, shape (n, p).
            ridge: Weights of its priors, shape (p,).
            spans: Rows of each episode.
        """
        wide = design.astype(np.float64)
        self._gram = wide.T @ wide
        least = 1e-8 * max(float(np.trace(self._gram)) / max(len(self._gram), 1), 1e-12)
        self._inverse = np.linalg.pinv(self._gram + np.diag(ridge + least), hermitian=True)
        self._twice = 2 * self._inverse - self._inverse @ self._gram @ self._inverse
        self._design, self._spans = design.astype(np.float32), spans

    def left(self, white: np.ndarray, moved: np.ndarray, swing: np.ndarray | None) -> np.ndarray:
        """Return columns (n, streams, k) without design, errors of pose (all streams alike) and swings (each alone)."""
        streams, kinds = white.shape[1], moved.shape[2]
        known = self._inner(white)
        result = white - self._said(self._inverse @ known).reshape(white.shape)
        known = known - self._gram @ (self._inverse @ known)  # D'C
        beside = self._beside(moved)  # p, streams, episodes, kinds
        size = len(self._spans) * kinds
        flat = beside.reshape(len(self._gram), streams, size)
        twice = np.tensordot(self._twice, flat, axes=1)
        matrix = np.eye(size) - np.tensordot(flat, twice, axes=([0, 1], [0, 1]))
        right = np.empty((size, white.shape[2]))
        for e, rows in enumerate(self._spans):
            part = slice(e * kinds, (e + 1) * kinds)
            own = moved[rows].reshape(-1, kinds)
            matrix[part, part] += (own.T @ own).astype(np.float64)
            right[part] = own.T @ result[rows].reshape(len(own), -1)
        inverse = self._inverse
        shared = np.tensordot(flat, np.tensordot(inverse, known.reshape(len(inverse), streams, -1), axes=1),
                              axes=([0, 1], [0, 1]))  # fmt: skip
        weights = np.linalg.solve(matrix, right - shared)
        result, known = self._less(result, known, moved, weights.reshape(-1, kinds, white.shape[2]), flat @ weights)
        return result if swing is None else self._steadied(result, known, swing)

    def _less(
        self, result: np.ndarray, known: np.ndarray, moved: np.ndarray, weights: np.ndarray, through: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take C T z off, and from D' of it; ``through`` is D'T z, shape (p, streams, k)."""
        for e, rows in enumerate(self._spans):
            result[rows] -= moved[rows] @ weights[e].astype(np.float32)
        inner = through.reshape(len(self._gram), -1)
        result += self._said(self._inverse @ inner).reshape(result.shape)
        return result, known - inner + self._gram @ (self._inverse @ inner)

    def _steadied(self, result: np.ndarray, known: np.ndarray, swing: np.ndarray) -> np.ndarray:
        streams, width = result.shape[1:]
        beside = self._beside(swing[:, :, None])[:, :, :, 0].transpose(1, 0, 2)  # streams, p, episodes
        matrix = np.eye(len(self._spans)) - beside.transpose(0, 2, 1) @ (self._twice @ beside)
        right = np.empty((streams, len(self._spans), width))
        for e, rows in enumerate(self._spans):
            matrix[:, e, e] += np.square(swing[rows]).sum(axis=0)
            right[:, e] = np.einsum("ns,nsk->sk", swing[rows], result[rows], optimize=True)
        inner = (self._inverse @ known).reshape(len(self._gram), streams, width).transpose(1, 0, 2)
        weights = np.linalg.solve(matrix, right - beside.transpose(0, 2, 1) @ inner)
        for e, rows in enumerate(self._spans):
            result[rows] -= swing[rows][:, :, None] * weights[:, e].astype(np.float32)
        through = (beside @ weights).transpose(1, 0, 2).reshape(len(self._gram), -1)
        return result + self._said(self._inverse @ through).reshape(result.shape)

    def _inner(self, block: np.ndarray) -> np.ndarray:
        return (self._design.T @ block.reshape(len(block), -1)).astype(np.float64)

    def _said(self, weights: np.ndarray) -> np.ndarray:
        return self._design @ weights.astype(np.float32)

    def _beside(self, block: np.ndarray) -> np.ndarray:
        """Return D'T of episodes' own columns (n, streams, kinds), shape (p, streams, episodes, kinds)."""
        parts = [self._design[rows].T @ block[rows].reshape(len(rows), -1) for rows in self._spans]
        return np.stack([p.reshape(len(self._gram), *block.shape[1:]) for p in parts], axis=2).astype(np.float64)


def _without_offsets(block: np.ndarray, own: np.ndarray, noise: Noise) -> np.ndarray:
    """Return a tag's streams of one place without their offset there and, by its prior, each episode's own."""
    design = np.column_stack([own.sum(axis=1), own]).astype(np.float64)
    gram = design.T @ design
    ridge = np.full(len(gram), float(noise.tag or 1.0) ** -2)
    ridge[0] = 1e-8 * max(float(gram[0, 0]), 1e-12)
    factor = np.linalg.solve(gram + np.diag(ridge), design.T)
    flat = block.reshape(len(block), -1)
    return (flat - design @ (factor @ flat)).astype(np.float32).reshape(block.shape)
