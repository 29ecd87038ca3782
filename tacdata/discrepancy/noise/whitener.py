"""The whitener: columns as generalized least squares sees them. What is the same for all columns is factored once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise.episode_gls import EpisodeErrorModel, FactoredErrors
from tacdata.discrepancy.noise.gram import EpisodeGrams
from tacdata.discrepancy.noise.noise_model import Noise


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


@dataclass(frozen=True)
class _Place:
    """Rows of the episodes of one place, with what they err by."""

    rows: np.ndarray
    episode: np.ndarray
    offset: np.ndarray
    seen: FactoredErrors
    tag: FactoredErrors | None


class Whitener:
    """Whitens columns, and projects out what the response may take up, place by place."""

    def __init__(
        self, course: Course, noise: Noise, context: np.ndarray, features: np.ndarray | None, pose_errors: np.ndarray,
        like: Whitener | None = None,
    ) -> None:  # fmt: skip
        """Factor what is the same for all columns.

        Args:
            course: Whose rows.
            noise: Noise model.
            context: Group of rows that share features, shape (n,); an episode lies in one.
            features: What the response may take up, shape (n, k); None for nothing but offsets.
            pose_errors: Change by an episode's pose errors of one standard deviation, shape (n, streams, kinds).
            like: Of the same course, context and noise, but for gains: its offsets are not factored again.
        """
        self.features = features
        self._course, self._noise, offsets = course, noise, noise.offsets
        streams = len(noise.scale)
        self._seen = seen = streams - (3 if noise.tag is not None else 0)
        flat = replace(noise, scale=np.ones(1))
        one = replace(flat, missing=None)
        offset = whiten(np.ones((course.rows, streams, 1)), course, flat)[:, :, 0]
        moved = whiten(pose_errors, course, noise)
        random_walk = None
        if noise.random_walk is not None and like is None:
            each = np.broadcast_to(noise.random_walk[:, None, :], (course.rows, streams, noise.random_walk.shape[1]))
            random_walk = whiten(each, course, flat)
        swung = None if noise.gain_error is None else whiten(noise.gain_error[:, :, None], course, noise)[:, :, 0]
        ahead = None
        if offsets is not None and features is not None:
            ahead = offsets.expected(features[:, None, :]).astype(np.float32)
        order = np.argsort(context, kind="stable")
        self._places: list[_Place] = []
        # A place at a time: columns of all rows together would not stay in a processor's cache.
        for number, group in enumerate(np.split(order, np.flatnonzero(np.diff(context[order])) + 1)):
            local = course.episode[group]
            rows = np.argsort(local, kind="stable")
            spans = np.split(rows, np.flatnonzero(np.diff(local[rows])) + 1)
            free = np.full(len(spans), np.inf)
            shared = None
            if features is not None:
                used = np.abs(features[group]).max(axis=0) > 1e-9
                # Where noise is not alike in all streams, whitened features are not.
                shared = whiten(features[group][:, None, used], course, one, group)
                if ahead is not None:
                    ones = whiten(np.ones((len(group), 1, 1)), course, one, group)[:, :, 0]
                    _follow(shared, ones, local, ahead[:, :, used])
            own = EpisodeErrorModel(
                _turned(offset[group, :seen]),
                free if offsets is None else offsets.spread[[local[span[0]] for span in spans]],
                None if swung is None else _turned(swung[group, :seen]),
                _turned(moved[group, :seen]),
                None if shared is None else _features(shared, offset[group, :seen]),
                None if random_walk is None else _turned(random_walk[group, :seen]),
            )  # fmt: skip
            tag = None
            if seen < streams:
                # A tag knows nothing of the response: it has a free offset for the place, and each episode's own.
                prior = np.full(len(spans), float(noise.tag or 1.0))
                free_offset = _turned(offset[group, seen:, None])
                tag_errors = EpisodeErrorModel(_turned(offset[group, seen:]), prior, features=free_offset)
                tag = FactoredErrors(spans, tag_errors)
            before = None if like is None else like._places[number].seen
            self._places.append(_Place(group, local, offset[group], FactoredErrors(spans, own, before), tag))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the features, at all places and of all streams [1]."""
        return sum(place.seen.freedom for place in self._places)

    def parts(self, columns: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Give the rows of each place, and columns there whitened and without nuisances, shape (m, streams, k).

        Args:
            columns: Shape (n, streams, k).
        """
        noise, seen, expected = self._noise, self._seen, None
        if noise.offsets is not None:
            gone = None if noise.missing is None else noise.missing[:, :seen]
            expected = noise.offsets.expected(columns[:, :seen], gone)
            expected = (expected / noise.scale[:seen, None]).astype(np.float32)
        for place in self._places:
            white = whiten(columns[place.rows], self._course, noise, place.rows)
            if expected is not None:
                _follow(white[:, :seen], place.offset, place.episode, expected)
            part = np.empty_like(white)
            part[:, :seen] = _turned(place.seen.without(_turned(white[:, :seen])))
            if place.tag is not None:
                part[:, seen:] = _turned(place.tag.without(_turned(white[:, seen:])))
            yield place.rows, part

    def stream_scores(self, residual: np.ndarray, alone: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return scores and information of columns that each stand in one stream of one episode.

        Args:
            residual: Shape (n, streams).
            alone: The columns of all streams and episodes, shape (n, streams).

        Returns:
            Scores and information [1], shapes (episodes, streams); 0 where nothing is known.
        """
        score, known = np.zeros((2, self._course.episodes, residual.shape[1]))
        white = whiten(alone[:, : self._seen, None], self._course, self._of_seen())[:, :, 0]
        for place, (rows, part) in zip(self._places, self.parts(residual[:, :, None]), strict=True):
            episodes = np.unique(place.episode)
            own = place.seen.stream_scores(_turned(part[:, : self._seen, 0]), _turned(white[rows]))
            score[episodes, : self._seen], known[episodes, : self._seen] = own
        return score, np.maximum(known, 0.0)

    def episode_scores(self, residual: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return scores and information of columns, each episode by itself.

        Args:
            residual: Shape (n, streams).
            columns: Shape (n, streams, k).

        Returns:
            Scores, shape (episodes, k), and information, shape (episodes, k, k) [1]; 0 where nothing is known.
        """
        count = columns.shape[2]
        score, known = np.zeros((self._course.episodes, count)), np.zeros((self._course.episodes, count, count))
        white = whiten(columns, self._course, self._noise)
        for place, (rows, part) in zip(self._places, self.parts(residual[:, :, None]), strict=True):
            episodes, own = np.unique(place.episode), white[rows]
            score[episodes], known[episodes] = place.seen.episode_scores(
                _turned(part[:, : self._seen, 0]), _turned(own[:, : self._seen])
            )
            if place.tag is not None:
                more = place.tag.episode_scores(_turned(part[:, self._seen :, 0]), _turned(own[:, self._seen :]))
                score[episodes] += more[0]
                known[episodes] += more[1]
        return score, known

    def _of_seen(self) -> Noise:
        noise, seen = self._noise, self._seen
        missing = None if noise.missing is None else noise.missing[:, :seen]
        relative = None if noise.relative_scale is None else noise.relative_scale[:, :seen]
        return replace(noise, scale=noise.scale[:seen], missing=missing, relative_scale=relative)

    def whitened(self, columns: np.ndarray) -> np.ndarray:
        """Return columns whitened and without nuisances, shape (n, streams, k)."""
        result = np.zeros(columns.shape, dtype=np.float32)
        for rows, part in self.parts(columns):
            result[rows] = part
        return result

    def projected(self, white: np.ndarray) -> np.ndarray:
        """Return what is left of noise, drawn white, shape (n, streams, draws): features take up some of it."""
        result = np.zeros(white.shape, dtype=np.float32)
        for place in self._places:
            own = white[place.rows].astype(np.float32) * (place.offset != 0)[:, :, None]
            own[:, : self._seen] = _turned(place.seen.projected(_turned(own[:, : self._seen])))
            if place.tag is not None:
                own[:, self._seen :] = _turned(place.tag.projected(_turned(own[:, self._seen :])))
            result[place.rows] = own
        return result

    def episode_grams(self, columns: np.ndarray, beside: np.ndarray | None = None) -> EpisodeGrams:
        """Reduce columns to `Evidence`.

        Args:
            columns: Residual first, then effects, shape (n, streams, 1 + columns).
            beside: Further columns, cleaned before, shape (n, streams, more).
        """
        course = self._course
        width = columns.shape[2] + (0 if beside is None else beside.shape[2])
        gram, rows = np.zeros((course.episodes, width, width)), np.zeros(course.episodes)
        for group, part in self.parts(columns):
            whole = part if beside is None else np.concatenate([part, beside[group]], axis=2)
            edges = np.flatnonzero(np.diff(course.episode[group], prepend=-1))
            for begin, end in pairwise([*edges, len(group)]):
                flat = whole[begin:end].reshape(-1, width)
                number = course.episode[group[begin]]
                gram[number] = flat.T @ flat
                rows[number] = flat.shape[0]
        return EpisodeGrams(gram, rows)


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
    """Return features of each stream, shape (streams, n, p), 0 where nothing was read.

    Args:
        shared: Whitened features, shape (n, streams or 1, p).
        offset: Whitened constants, 0 where nothing was read, shape (n, streams).
    """
    there = (offset != 0).T.astype(np.float32)
    return there[:, :, None] * np.swapaxes(shared[:, : len(there)], 0, 1)
