"""The whitener of columns for generalized least squares. The part common to all columns is factored once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise.episode_gls import EpisodeErrorModel, FactoredErrors, JointScores
from tacdata.discrepancy.noise.gram import EpisodeGrams
from tacdata.discrepancy.noise.noise_model import Noise


@dataclass(frozen=True)
class Colour:
    """The scale and the memory of noise, by which readings are whitened."""

    own: np.ndarray
    """Factor of a reading [1 / its unit], shape (n, streams), float32; 0 where nothing is known."""
    before: np.ndarray
    """Factor of the one before, which is subtracted [1 / unit], shape (n, streams), float32; 0 in first rows."""
    unknown: np.ndarray | None
    """Where nothing is known, as it or the one before is missing, shape (n, streams), bool; None: nowhere."""

    @classmethod
    def of(cls, course: Course, noise: Noise) -> Colour:
        """Return an AR(1) filter in episodes, phi^(dt / step) by time, between divisions by both scales."""
        decay = noise.memory ** np.clip(course.step / noise.step, 0.0, 50.0)
        decay = np.where(course.first, 0.0, decay)
        spread = np.sqrt(np.maximum(1 - decay**2, 1e-6) / max(1 - noise.memory**2, 1e-6))
        # A mean counts as four readings at most: slow noise does not average out.
        factor = 1 / ((spread / np.sqrt(np.minimum(course.averaged, 4.0)))[:, None] * noise.scale)
        previous_factor = decay[:, None] * factor
        if noise.relative_scale is not None:
            factor, previous_factor = (
                factor / noise.relative_scale,
                previous_factor / np.roll(noise.relative_scale, 1, axis=0),
            )
        gone = None
        if noise.missing is not None:
            gone = noise.missing.copy()
            # A reading after a missing one cannot be whitened either.
            gone[1:] |= noise.missing[:-1] & ~course.first[1:, None]
            factor, previous_factor = np.where(gone, 0.0, factor), np.where(gone, 0.0, previous_factor)
        return cls(factor.astype(np.float32), previous_factor.astype(np.float32), gone)

    def white(self, values: np.ndarray, rows: slice | np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """Return columns whitened, shape (m, streams, columns), float32.

        Args:
            values: Of some rows, shape (m, streams, columns).
            rows: Which, of whole episodes.
            out: Where they are written, of their shape, if anywhere.
        """
        values = values.astype(np.float32, copy=False)
        result = np.multiply(values, self.own[rows][:, :, None], out=out)
        result[1:] -= values[:-1] * self.before[rows][1:, :, None]
        if self.unknown is not None:
            result[self.unknown[rows]] = 0.0
        return result


def whiten(values: np.ndarray, course: Course, noise: Noise) -> np.ndarray:
    """Return columns of all rows of a course whitened, shape (n, streams, columns)."""
    return Colour.of(course, noise).white(values, slice(None))


@dataclass(frozen=True)
class _Place:
    """Rows of the episodes of one place, with their error covariance."""

    rows: np.ndarray
    """Shape (m,), int64."""
    episodes: np.ndarray
    """Their numbers, in order, shape (k,), int64."""
    spans: list[tuple[slice, slice]]
    """Of each episode: its rows in the course, and where they stand in `rows`."""
    offset: np.ndarray
    """A whitened constant, 0 where nothing was read, shape (streams, m)."""
    seen: FactoredErrors
    tag: FactoredErrors | None


class Whitener:
    """Whitens columns, and projects out the response's degrees of freedom, place by place."""

    def __init__(
        self,
        course: Course,
        noise: Noise,
        context: np.ndarray,
        features: np.ndarray | None,
        pose_errors: np.ndarray,
        template: Whitener | None = None,
    ) -> None:
        """Factor the part common to all columns.

        Args:
            course: Whose rows.
            noise: Noise model.
            context: Group of rows that share features, shape (n,); an episode is in one.
            features: Degrees of freedom of the response, shape (n, k), or (n, streams, k) where it differs between
                streams; None for nothing but offsets.
            pose_errors: Change by an episode's pose errors of one standard deviation, shape (n, streams, kinds).
            template: Of the same course, context and noise, but for gains: its offsets are not factored again.
        """
        self.features = features
        self._course, self._noise, offsets = course, noise, noise.offsets
        streams = len(noise.scale)
        self._seen = readable = streams - (3 if noise.tag is not None else 0)
        self._colour = Colour.of(course, noise)
        flat = replace(noise, scale=np.ones(1))
        unit_colour = Colour.of(course, replace(flat, missing=None))
        offset = whiten(np.ones((course.rows, streams, 1)), course, flat)[:, :, 0]
        white_pose = self._colour.white(pose_errors, slice(None))
        random_walk = None
        if noise.random_walk is not None and template is None:
            each = np.broadcast_to(noise.random_walk[:, None, :], (course.rows, streams, noise.random_walk.shape[1]))
            random_walk = whiten(each, course, flat)
        white_gain = None
        if noise.gain_error is not None:
            white_gain = self._colour.white(noise.gain_error[:, :, None], slice(None))[:, :, 0]
        expected_offsets = None
        if offsets is not None and features is not None:
            expected_offsets = offsets.expected(_each(features)).astype(np.float32)
        order = np.argsort(context, kind="stable")
        self._places: list[_Place] = []
        # A place at a time: columns of all rows together would not stay in a processor's cache.
        for number, group in enumerate(np.split(order, np.flatnonzero(np.diff(context[order])) + 1)):
            spans = _spans(group, course)
            episodes = course.episode[[span[0].start for span in spans]]
            flat_prior = np.full(len(spans), np.inf)
            shared = None
            if features is not None:
                place_features = _each(features[group])
                used = np.abs(place_features).max(axis=(0, 1)) > 1e-9
                # Where noise is not equal in all streams, whitened features are not.
                shared = _turned(unit_colour.white(place_features[:, :, used], group))
                if expected_offsets is not None:
                    ones = _turned(unit_colour.white(np.ones((len(group), 1, 1)), group)[:, :, 0])
                    for episode, (_, at) in zip(episodes, spans, strict=True):
                        _follow(shared[:, at], ones[:, at], expected_offsets[episode][:, used])
            inside = [at for _, at in spans]
            model = EpisodeErrorModel(
                _turned(offset[group, :readable]),
                flat_prior if offsets is None else offsets.spread[episodes],
                None if white_gain is None else _turned(white_gain[group, :readable]),
                _turned(white_pose[group, :readable]),
                None if shared is None else _features(shared, offset[group, :readable]),
                None if random_walk is None else _turned(random_walk[group, :readable]),
            )
            tag = None
            if readable < streams:
                # A tag knows nothing of the response: it has a free offset for the place, and each episode's own.
                prior = np.full(len(spans), float(noise.tag or 1.0))
                free_offset = _turned(offset[group, readable:, None])
                tag_errors = EpisodeErrorModel(_turned(offset[group, readable:]), prior, features=free_offset)
                tag = FactoredErrors(inside, tag_errors)
            earlier_factors = None if template is None else template._places[number].seen
            factored = FactoredErrors(inside, model, earlier_factors)
            self._places.append(_Place(group, episodes, spans, _turned(offset[group]), factored, tag))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the features, at all places and of all streams [1]."""
        return sum(place.seen.freedom for place in self._places)

    def _parts(self, columns: np.ndarray) -> Iterator[tuple[_Place, np.ndarray]]:
        """Give each place with columns there whitened and without nuisances, shape (streams, m, k).

        Args:
            columns: Shape (n, streams, k).
        """
        noise, readable, expected = self._noise, self._seen, None
        if noise.offsets is not None:
            gone = None if noise.missing is None else noise.missing[:, :readable]
            expected = noise.offsets.expected(columns[:, :readable], gone)
            expected = (expected / noise.scale[:readable, None]).astype(np.float32)
        for place in self._places:
            part = np.empty((columns.shape[1], len(place.rows), columns.shape[2]), dtype=np.float32)
            for number, (rows, at) in zip(place.episodes, place.spans, strict=True):
                self._colour.white(columns[rows], rows, part[:, at].swapaxes(0, 1))
                if expected is not None:
                    _follow(part[:readable, at], place.offset[:, at], expected[number])
            place.seen.take_out(part[:readable])
            if place.tag is not None:
                place.tag.take_out(part[readable:])
            yield place, part

    def stream_scores(self, residual: np.ndarray, single_columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return scores and information of columns that each stand in one stream of one episode.

        Args:
            residual: Shape (n, streams).
            single_columns: The columns of all streams and episodes, shape (n, streams).

        Returns:
            Scores and information [1], shapes (episodes, streams); 0 where nothing is known.
        """
        score, information = np.zeros((2, self._course.episodes, residual.shape[1]))
        white = whiten(single_columns[:, : self._seen, None], self._course, self._of_seen())[:, :, 0]
        for place, part in self._parts(residual[:, :, None]):
            place_scores = place.seen.stream_scores(part[: self._seen, :, 0], _turned(white[place.rows]))
            score[place.episodes, : self._seen], information[place.episodes, : self._seen] = place_scores
        return score, np.maximum(information, 0.0)

    def joint_scores(self, residual: np.ndarray, columns: np.ndarray) -> list[JointScores]:
        """Return scores and information of columns of which each episode has its own, place by place.

        Args:
            residual: Shape (n, streams).
            columns: Shape (n, streams, k).
        """
        scores, white = [], self._colour.white(columns, slice(None))
        for place, part in self._parts(residual[:, :, None]):
            place_columns = _turned(white[place.rows])
            runs = place.seen.joint_scores(part[: self._seen, :, 0], place_columns[: self._seen])
            if place.tag is not None:
                more = place.tag.joint_scores(part[self._seen :, :, 0], place_columns[self._seen :])
                runs = [
                    replace(run, score=run.score + tag.score, information=run.information + tag.information)
                    for run, tag in zip(runs, more, strict=True)
                ]
            scores += [replace(run, episodes=place.episodes[run.episodes]) for run in runs]
        return scores

    def _of_seen(self) -> Noise:
        noise, readable = self._noise, self._seen
        missing = None if noise.missing is None else noise.missing[:, :readable]
        relative = None if noise.relative_scale is None else noise.relative_scale[:, :readable]
        return replace(noise, scale=noise.scale[:readable], missing=missing, relative_scale=relative)

    def whitened(self, columns: np.ndarray) -> np.ndarray:
        """Return columns whitened and without nuisances, shape (n, streams, k)."""
        result = np.empty(columns.shape, dtype=np.float32)
        for place, part in self._parts(columns):
            for rows, at in place.spans:
                result[rows] = part[:, at].swapaxes(0, 1)
        return result

    def projected(self, white: np.ndarray) -> np.ndarray:
        """Return cleaned noise, drawn white, shape (n, streams, draws): features absorb some of it."""
        result = np.zeros(white.shape, dtype=np.float32)
        for place in self._places:
            draws = _turned(white[place.rows].astype(np.float32)) * (place.offset != 0)[:, :, None]
            place.seen.project(draws[: self._seen])
            if place.tag is not None:
                place.tag.project(draws[self._seen :])
            result[place.rows] = draws.swapaxes(0, 1)
        return result

    def episode_grams(self, columns: np.ndarray, cleaned: np.ndarray | None = None) -> EpisodeGrams:
        """Reduce columns to `Evidence`.

        Args:
            columns: Residual first, then effects, shape (n, streams, 1 + columns).
            cleaned: Further columns, cleaned before, shape (n, streams, more).
        """
        course = self._course
        width = columns.shape[2] + (0 if cleaned is None else cleaned.shape[2])
        gram, rows = np.zeros((course.episodes, width, width)), np.zeros(course.episodes)
        first_width = columns.shape[2]
        for place, part in self._parts(columns):
            for number, (episode_rows, at) in zip(place.episodes, place.spans, strict=True):
                flat = part[:, at].reshape(-1, first_width)
                gram[number, :first_width, :first_width], rows[number] = flat.T @ flat, len(flat)
                if cleaned is not None:
                    flat_cleaned = _turned(cleaned[episode_rows]).reshape(len(flat), width - first_width)
                    cross = flat.T @ flat_cleaned
                    gram[number, :first_width, first_width:], gram[number, first_width:, :first_width] = cross, cross.T
                    gram[number, first_width:, first_width:] = flat_cleaned.T @ flat_cleaned
        return EpisodeGrams(gram, rows)


def _spans(group: np.ndarray, course: Course) -> list[tuple[slice, slice]]:
    """Return each episode's rows in the course, and where they stand among a place's rows, which are in order."""
    edges = np.flatnonzero(np.diff(course.episode[group], prepend=-1))
    pairs = pairwise([*edges.tolist(), len(group)])
    return [(slice(int(group[a]), int(group[b - 1]) + 1), slice(a, b)) for a, b in pairs]


def _follow(white: np.ndarray, offset: np.ndarray, expected: np.ndarray) -> None:
    """Take off an episode's columns, in place, their expectation by the offsets of the episodes before.

    Args:
        white: Whitened, shape (streams, n, columns).
        offset: Whitened constants, shape (streams or more, n).
        expected: In noise scales, shape (streams, columns).
    """
    white -= offset[: len(white), :, None] * expected[:, None, :]


def _each(features: np.ndarray) -> np.ndarray:
    """Return features of every stream, shape (n, streams, k), or (n, 1, k) if all have the same."""
    return features if features.ndim == 3 else features[:, None, :]


def _turned(values: np.ndarray) -> np.ndarray:
    """Return values with rows and streams exchanged."""
    return np.ascontiguousarray(np.swapaxes(values, 0, 1))


def _features(shared: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return features of each stream, shape (streams, n, p), or (1, n, p) if they are equal; 0 where nothing was read.

    Args:
        shared: Whitened features, shape (streams or 1, n, p).
        offset: Whitened constants, 0 where nothing was read, shape (n, streams).
    """
    present = (offset != 0).T.astype(np.float32)
    if len(shared) == 1 and np.array_equal(offset, np.broadcast_to(offset[:, :1], offset.shape)):
        return present[:1, :, None] * shared
    return present[:, :, None] * shared[: len(present)]
