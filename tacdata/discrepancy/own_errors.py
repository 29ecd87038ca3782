"""Generalized least squares beside what episodes err by themselves.

Rows of an episode scatter with covariance 1 + A A' + T T': A its own offset of every stream, T its own errors of pose,
which all streams share, and its own gains of the streams. Columns are multiplied by the root of the inverse of that, so
that inner products are those of generalized least squares (Aitken; the inverse by Woodbury): however much single
episodes err, what they have in common stays to be seen. Features that are free are projected out afterwards.

Gains of one episode have no mean, weighted by what the streams tell: what all streams do alike is an error of depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LEAST = 1e-8
"""Weight of what no row excites, of the mean of what rows do [1]."""


@dataclass(frozen=True)
class Own:
    """What the episodes of one place err by themselves, whitened; streams first."""

    offset: np.ndarray
    """A constant [1], shape (streams, n)."""
    prior: np.ndarray
    """Its standard deviation in each episode, in noise scales [1], shape (episodes,); inf leaves it free."""
    swing: np.ndarray | None = None
    """What one standard deviation of a stream's own gain changes [1], shape (streams, n)."""
    moved: np.ndarray | None = None
    """What one standard deviation of each error of pose changes [1], shape (streams, n, kinds)."""
    features: np.ndarray | None = None
    """What all episodes may take up together, each stream by itself [1], shape (streams, n, p)."""


def without(columns: np.ndarray, spans: list[np.ndarray], own: Own) -> np.ndarray:
    """Return columns as generalized least squares sees them.

    Args:
        columns: Whitened, shape (streams, n, k).
        spans: Rows of each episode.
        own: What they err by.
    """
    streams, _, width = columns.shape
    parts = {"moved": own.moved, "swing": None if own.swing is None else own.swing[:, :, None], "free": own.features}
    given = {name: value for name, value in parts.items() if value is not None}
    edges = np.cumsum([width, *(value.shape[2] for value in given.values())])[:-1]
    stacked = np.concatenate([columns, *given.values()], axis=2)
    result = np.empty_like(columns)
    free = None if own.features is None else _Free(streams, own.features.shape[2])
    later = []
    for rows, prior in zip(spans, own.prior, strict=True):
        pieces = np.split(_steadied(stacked[:, rows], own.offset[:, rows, None], float(prior)), edges, axis=2)
        left, rest = np.ascontiguousarray(pieces[0]), dict(zip(given, pieces[1:], strict=True))
        errors = _Errors(streams, len(rows), rest.get("moved"), rest.get("swing"))
        left = errors.rooted(left)
        if free is None:
            result[:, rows] = left
        else:
            later.append((rows, left, free.take(left, rest["free"], errors)))
    if free is not None:
        weights = free.weights()
        for rows, left, said in later:
            result[:, rows] = left - said(weights)
    return result


def _steadied(block: np.ndarray, offset: np.ndarray, prior: float) -> np.ndarray:
    """Return columns (streams, m, k) of one episode with its streams' own offsets accounted for."""
    power = np.maximum(np.square(offset).sum(axis=(1, 2)), 1e-12)[:, None, None]
    share = 1 / power if np.isinf(prior) else prior**2 * _root(prior**2 * power)
    return block - offset * ((offset.transpose(0, 2, 1) @ block) * share.astype(np.float32))


def _root(gram: np.ndarray) -> np.ndarray:
    """Return M of 1 - T M T', the root of the inverse of 1 + T T', for T'T, shape (..., k, k)."""
    values, vectors = np.linalg.eigh(gram.astype(np.float64))
    size = np.sqrt(1 + np.maximum(values, 0.0))
    return (vectors / (size * (size + 1))[..., None, :]) @ np.swapaxes(vectors, -1, -2)


class _Errors:
    """One episode's errors of pose and gain, T: kinds of pose, then a gain a stream."""

    def __init__(self, streams: int, rows: int, moved: np.ndarray | None, swing: np.ndarray | None) -> None:
        self._shape = streams, rows
        kinds = 0 if moved is None else moved.shape[2]
        pose = np.zeros((streams * rows, 0), dtype=np.float32) if moved is None else moved.reshape(-1, kinds)
        self._pose = np.ascontiguousarray(pose)
        self._swing = None if swing is None else np.ascontiguousarray(swing)
        if self._swing is not None:
            power = np.square(self._swing).sum(axis=(1, 2)).astype(np.float64)
            self._mean = power / max(float(power.sum()), 1e-12)
        every = [self._pose.reshape(streams, rows, kinds)]
        if self._swing is not None:
            every.append(self._gains(np.eye(streams)))
        self.gram = self.inner(np.concatenate(every, axis=2).astype(np.float32))
        self.root = _root(0.5 * (self.gram + self.gram.T))

    def inner(self, block: np.ndarray) -> np.ndarray:
        """Return T' of columns (streams, m, k), shape (kinds + streams, k)."""
        flat = block.reshape(len(self._pose), block.shape[2])
        parts = [(self._pose.T @ flat).astype(np.float64)]
        if self._swing is not None:
            each = (self._swing.transpose(0, 2, 1) @ block)[:, 0].astype(np.float64)
            parts.append(each - self._mean[:, None] * each.sum(axis=0))
        return np.concatenate(parts)

    def joint(self, shared: np.ndarray) -> np.ndarray:
        """Return T' of columns (streams, m, p), each in one stream alone, shape (streams, p, kinds + streams)."""
        turned = shared.transpose(0, 2, 1)
        parts = [turned @ self._pose.reshape(*self._shape, self._pose.shape[1])]
        if self._swing is not None:
            parts.append((turned @ self._swing) * (np.eye(len(shared)) - self._mean)[:, None, :])
        return np.concatenate(parts, axis=2).astype(np.float64)

    def said(self, weights: np.ndarray) -> np.ndarray:
        """Return T weights, shape (streams, m, k), for weights of shape (kinds + streams, k)."""
        kinds = self._pose.shape[1]
        result = (self._pose @ weights[:kinds].astype(np.float32)).reshape(*self._shape, weights.shape[1])
        return result if self._swing is None else result + self._gains(weights[kinds:])

    def _gains(self, weights: np.ndarray) -> np.ndarray:
        own = weights - self._mean @ weights
        return self._swing * own[:, None, :].astype(np.float32)

    def rooted(self, block: np.ndarray) -> np.ndarray:
        """Return columns (streams, m, k) times the root of the inverse of 1 + T T'."""
        return block - self.said(self.root @ self.inner(block))


class _Free:
    """Features of one place: normal equations, a block a stream, joined by the episodes' own errors."""

    def __init__(self, streams: int, width: int) -> None:
        self._blocks = np.zeros((streams, width, width))
        self._right: list[np.ndarray] = []
        self._joints: list[np.ndarray] = []
        self._inner: list[np.ndarray] = []

    def take(self, left: np.ndarray, shared: np.ndarray, errors: _Errors) -> Callable[[np.ndarray], np.ndarray]:
        """Take an episode in; return what says what given weights change in it."""
        streams, _, width = shared.shape
        turned = np.ascontiguousarray(shared.transpose(0, 2, 1))
        self._blocks += turned @ shared
        joint = errors.joint(shared)
        self._right.append((turned @ left).astype(np.float64) - joint @ (errors.root @ errors.inner(left)))
        self._joints.append(joint.reshape(streams * width, len(errors.gram)))
        self._inner.append(np.eye(len(errors.gram)) + errors.gram)

        def said(weights: np.ndarray) -> np.ndarray:
            through = errors.root @ np.einsum("spq,spk->qk", joint, weights, optimize=True)
            return shared @ weights.astype(np.float32) - errors.said(through)

        return said

    def weights(self) -> np.ndarray:
        """Return the weights that fit best, shape (streams, p, k)."""
        streams, width, _ = self._blocks.shape
        mean = np.einsum("spp->s", self._blocks) / width
        floor = LEAST * np.maximum(mean, 1e-12)[:, None, None] * np.eye(width)
        blocks = self._blocks + floor
        right, joint = np.sum(self._right, axis=0), np.concatenate(self._joints, axis=1)
        count = joint.shape[1]
        both = np.concatenate([right, joint.reshape(streams, width, count)], axis=2)
        solved = np.linalg.solve(blocks, both)
        alone, through = solved[:, :, : right.shape[2]], solved[:, :, right.shape[2] :]
        if not count:
            return alone
        matrix = -joint.T @ through.reshape(streams * width, count)
        at = 0
        for inner in self._inner:
            matrix[at : at + len(inner), at : at + len(inner)] += inner
            at += len(inner)
        pulled = joint.T @ alone.reshape(streams * width, right.shape[2])
        return alone + through @ np.linalg.solve(matrix, pulled)
