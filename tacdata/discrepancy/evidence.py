"""Sufficient statistics: what every episode says of every column, with nuisances and noise taken out.

The measured streams y of an episode are, to first order, y = f + A theta + B beta + Z z + e: f the model's prediction,
A what effects would add at their typical size, B what the response itself may still take up (splines of a fitted
response; constant offsets), z the episode's own error of depth with a prior, e coloured noise. Rows are whitened by an
AR(1) filter and each stream's scale, B is projected out exactly, z by ridge. What is left is kept as one Gram matrix
an episode, so that every fit, fold, bootstrap and sign flip afterwards is a small matrix problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.own_errors import Own, without
from tacdata.discrepancy.wander import Wander


@dataclass(frozen=True)
class Noise:
    """How readings scatter around the truth."""

    scale: np.ndarray
    """Standard deviation of the innovations [each stream's unit], shape (streams,)."""
    memory: float
    """Correlation of successive rows at the median step [1]."""
    wander: Wander | None = None
    """How episodes' offsets go on from one to the next; None leaves each free."""
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


def whiten(values: np.ndarray, course: Course, noise: Noise, rows: np.ndarray | None = None) -> np.ndarray:
    """Filter by e_i - phi^(dt / median dt) e_{i-1} within episodes and divide by the innovations' scale.

    Args:
        values: Shape (n, streams, columns).
        course: Whose rows.
        noise: Scales and memory.
        rows: Rows of the course, of whole episodes, that ``values`` are of; all, unless given.
    """
    some = slice(None) if rows is None else rows
    inside = course.step[~course.first]
    median = float(np.median(inside)) if len(inside) else 1.0
    decay = noise.memory ** np.clip(course.step / max(median, 1e-9), 0.0, 50.0)
    decay = np.where(course.first, 0.0, decay)[some]
    result = values.astype(np.float32)
    if noise.missing is not None:
        missing = noise.missing[some]
        result[missing] = 0.0
        before = result[:-1].copy()
        result[1:] -= decay[1:, None, None].astype(np.float32) * before
        gone = missing.copy()
        gone[1:] |= missing[:-1] & ~course.first[some][1:, None]
        result[gone] = 0.0
    else:
        result[1:] -= decay[1:, None, None].astype(np.float32) * values[:-1].astype(np.float32, copy=False)
    spread = np.sqrt(np.maximum(1 - decay**2, 1e-6) / max(1 - noise.memory**2, 1e-6))
    spread = spread / np.sqrt(np.minimum(course.averaged[some], 4.0))
    result /= (spread[:, None] * noise.scale[None]).astype(np.float32)[:, :, None]
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


def summed(columns: np.ndarray, course: Course) -> Evidence:
    """Return the `Evidence` of columns that are cleaned, shape (n, streams, 1 + columns)."""
    width = columns.shape[2]
    gram, rows = np.zeros((course.episodes, width, width)), np.zeros(course.episodes)
    for number in range(course.episodes):
        flat = columns[course.episode == number].reshape(-1, width)
        gram[number], rows[number] = flat.T @ flat, flat.shape[0]
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
    streams = columns.shape[1]
    seen = streams - (3 if noise.tag is not None else 0)
    flat = replace(noise, scale=np.ones(1))
    one = replace(flat, missing=None)
    offset = whiten(np.ones((course.rows, streams, 1)), course, flat)[:, :, 0]
    moved = whiten(jitter, course, noise)
    swung = None if noise.swing is None else whiten(noise.swing[:, :, None], course, noise)[:, :, 0]
    shared = None if features is None else whiten(features[:, None, :], course, one)
    expected = None
    if noise.wander is not None:
        gone = None if noise.missing is None else noise.missing[:, :seen]
        expected = noise.wander.expected(columns[:, :seen], gone)
        expected = (expected / noise.scale[:seen, None]).astype(np.float32)
        if shared is not None and features is not None:
            ones = whiten(np.ones((course.rows, 1, 1)), course, one)[:, :, 0]
            said = noise.wander.expected(features[:, None, :]).astype(np.float32)
            _follow(shared, ones, course.episode, said)
    order = np.argsort(context, kind="stable")
    # A place at a time: columns of all rows together would not stay in a processor's cache.
    for group in np.split(order, np.flatnonzero(np.diff(context[order])) + 1):
        local = course.episode[group]
        rows = np.argsort(local, kind="stable")
        spans = np.split(rows, np.flatnonzero(np.diff(local[rows])) + 1)
        white = whiten(columns[group], course, noise, group)
        if expected is not None:
            _follow(white[:, :seen], offset[group], local, expected)
        free = np.full(len(spans), np.inf)
        own = Own(
            _turned(offset[group, :seen]),
            free if noise.wander is None else noise.wander.spread[[local[span[0]] for span in spans]],
            None if swung is None else _turned(swung[group, :seen]),
            _turned(moved[group, :seen]),
            None if shared is None else _features(shared[group, 0], offset[group, :seen]),
        )  # fmt: skip
        part = np.empty_like(white)
        part[:, :seen] = _turned(without(_turned(white[:, :seen]), spans, own))
        if seen < streams:
            # A tag knows nothing of the response: it has a free offset for the place, and each episode's own.
            own = Own(
                _turned(offset[group, seen:]), np.full(len(spans), float(noise.tag or 1.0)),
                features=_turned(offset[group, seen:, None]),
            )  # fmt: skip
            part[:, seen:] = _turned(without(_turned(white[:, seen:]), spans, own))
        yield group, part


def _follow(white: np.ndarray, offset: np.ndarray, episode: np.ndarray, expected: np.ndarray) -> None:
    """Take off whitened columns, in place, what the offsets of the episodes before let one expect.

    Args:
        white: Shape (n, streams, columns).
        offset: Whitened constants, shape (n, streams or more).
        episode: Of each row, shape (n,).
        expected: In noise scales, shape (episodes, streams, columns).
    """
    edges = np.flatnonzero(np.diff(episode, prepend=-1))
    for begin, end in zip(edges, [*edges[1:], len(episode)], strict=True):
        white[begin:end] -= offset[begin:end, : white.shape[1], None] * expected[episode[begin]]


def _turned(values: np.ndarray) -> np.ndarray:
    """Return values with rows and streams exchanged."""
    return np.ascontiguousarray(np.swapaxes(values, 0, 1))


def _features(shared: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return features of each stream, shape (streams, n, p), without those that are nowhere and where nothing was read.

    Args:
        shared: Whitened features, shape (n, k).
        offset: Whitened constants, 0 where nothing was read, shape (n, streams).
    """
    used = shared[:, np.abs(shared).max(axis=0) > 1e-9]
    there = (offset != 0).T.astype(np.float32)
    return there[:, :, None] * used[None]
