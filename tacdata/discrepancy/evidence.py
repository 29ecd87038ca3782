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
    count, streams, width = white.shape
    numbers, local = np.unique(episode, return_inverse=True)
    own = np.zeros((count, len(numbers)), dtype=np.float32)
    own[np.arange(count), local] = offset[:, 0]
    design = own if shared is None else np.column_stack([own, shared[group]])
    used = np.abs(design).max(axis=0) > 1e-9
    design = design[:, used].astype(np.float64)
    gram = design.T @ design
    ridge = np.full(len(gram), 1e-8 * max(float(np.trace(gram)) / max(len(gram), 1), 1e-12))
    ridge[: used[: len(numbers)].sum()] += 0.0 if np.isinf(noise.offset) else noise.offset**-2
    factor = (np.linalg.pinv(gram + np.diag(ridge), hermitian=True) @ design.T).astype(np.float32)
    design = design.astype(np.float32)

    def clean(block: np.ndarray) -> np.ndarray:
        flat = block.reshape(count, -1)
        return (flat - design @ (factor @ flat)).reshape(block.shape)

    white = clean(white)
    kinds = moved.shape[2]
    turned = np.zeros((count, streams, len(numbers), kinds), dtype=np.float32)
    turned[np.arange(count), :, local] = moved
    turned = clean(turned).reshape(count * streams, -1)
    flat = white.reshape(count * streams, width)
    weights = np.linalg.solve(
        (turned.T @ turned).astype(np.float64) + np.eye(turned.shape[1]), (turned.T @ flat).astype(np.float64)
    )
    left = (flat - turned @ weights.astype(np.float32)).reshape(count, streams, width)
    if swing is not None:
        apart = np.zeros((count, streams, len(numbers)), dtype=np.float32)
        apart[np.arange(count), :, local] = swing
        apart = clean(apart).transpose(1, 0, 2)  # a stream, its rows, its episodes
        power = (apart.transpose(0, 2, 1) @ apart).astype(np.float64) + np.eye(len(numbers))
        product = (apart.transpose(0, 2, 1) @ left.transpose(1, 0, 2)).astype(np.float64)
        left -= (apart @ np.linalg.solve(power, product).astype(np.float32)).transpose(1, 0, 2)
    return left
