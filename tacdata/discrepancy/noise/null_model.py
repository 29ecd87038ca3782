"""The null model: noise and nuisances, estimated once, that all effects are tested against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tacdata.chain import Course, Prediction, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.contexts import contexts
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise import offset_random_walk, readings, table_error
from tacdata.discrepancy.noise.episode_errors import EpisodeErrors, ErrorSizes
from tacdata.discrepancy.noise.gram import episode_grams
from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.nuisances import nuisance_columns, pose_errors
from tacdata.discrepancy.noise.whitener import Whitener
from tacdata.discrepancy.regressors.generic import generic, slow
from tacdata.discrepancy.statistics.gram_fit import fold_of
from tacdata.effects import Placed

LEAST_GAIN_ERROR = 0.003
"""Least standard deviation of a stream's gain in an episode: no response is exact [1]."""
NOISE_DRAWS = 2
"""Draws of noise by which the J test estimates how two models differ by noise alone."""
ROUNDS = 3
"""Most alternations between estimates of pose errors and of gain errors..."""
SETTLED = 0.1
"""...until none changes by more than this share [1]."""
ODD = 0.3
"""Where an episode counts less, the over-rich fit for the estimate of errors is repeated with its weights [1]."""


@dataclass(frozen=True)
class NullModel:
    """Noise and nuisances of the model as it was given; the same while effects are added and dropped."""

    context: np.ndarray
    """Group of rows that share features, of the rows read, shape (m,), int64."""
    features: np.ndarray | None
    """Features that the response absorbs [1], shape (m, k); None if it was not fitted."""
    errors: np.ndarray
    """Effect of an episode's own errors of pose [each stream's unit], shape (m, streams, kinds)."""
    ridge: np.ndarray
    """Weights of their priors [1], shape (k,)."""
    beside: np.ndarray
    """Columns of nuisances, then those that belong to no effect, whitened and cleaned [1], shape (m, streams, k)."""
    nuisances: np.ndarray
    """Those of nuisances alone [1], shape (m, streams, nuisances)."""
    inner: np.ndarray
    """Their Gram matrices [1], shape (episodes, nuisances, nuisances)."""
    noise: Noise
    """Noise as an over-rich fit leaves it."""
    folds: np.ndarray
    """Fold of each episode, shape (episodes,), int64."""
    whitener: Whitener
    """Takes nuisances out of columns, for the model as it was given."""
    odd: np.ndarray
    """Episodes that err by far more than the others, shape (k,), int64."""
    draws: np.ndarray
    """White noise, drawn [noise scales], shape (m, streams, draws)."""
    sizes: np.ndarray | None = None
    """Of errors of pose, over their priors [1], shape (kinds,); None: as their priors."""
    spread: float = 0.0
    """Of the gain of a stream of an episode, as a standard deviation [1]."""

    @classmethod
    def of(
        cls,
        reduced: Course,
        context: np.ndarray,
        features: np.ndarray | None,
        errors: np.ndarray,
        ridge: np.ndarray,
        columns: np.ndarray,
        noise: Noise,
        folds: np.ndarray,
        whitener: Whitener | None = None,
        odd: np.ndarray | None = None,
        sizes: np.ndarray | None = None,
        spread: float = 0.0,
    ) -> NullModel:
        """Return the null model of the rows read, with its derived quantities."""
        # A fixed seed: the same recordings must give the same verdict.
        white = np.random.default_rng(17).normal(size=(reduced.rows, len(noise.scale), NOISE_DRAWS))
        nuisances = np.ascontiguousarray(columns[:, :, : len(ridge)])
        return cls(
            context,
            features,
            errors,
            ridge,
            columns,
            nuisances,
            episode_grams(nuisances, reduced).gram,
            noise,
            folds,
            whitener or Whitener(reduced, noise, context, features, errors),
            np.zeros(0, dtype=np.int64) if odd is None else odd,
            white,
            sizes,
            spread,
        )

    def whitener_for(self, setting: Setting, placed: Sequence[Placed], predicted: Prediction | None = None) -> Whitener:
        """Return the cleaner that projects nuisances out of columns, given a model's response.

        The response's degrees of freedom, and an episode's own errors of pose and gain, pass through the model's
        effects: those of another one would hold its effect, of which any share might then be every episode's error.
        They keep the estimated size: a model with larger readings is not allowed larger errors for it.

        Args:
            setting: With the model's response.
            placed: Its effects, given ones first.
            predicted: Its prediction, where that is known already.
        """
        course, own_features = setting.course, self.whitener.features
        features = taken_up(course, setting.response, placed)
        # Most effects leave the pose unchanged: the factors of the covariance are then reused.
        if features is own_features or (
            features is not None and own_features is not None and np.array_equal(features, own_features)
        ):
            return self.whitener
        errors, noise = self.errors, self.noise
        if setting.response.fitted and noise.gain_error is not None:
            episode, streams = course.reduced.episode, Streams.of(course)
            prediction = predicted or predict(course, setting.response, list(placed))
            errors = as_large(pose_errors(setting, placed, prediction), errors, episode)
            rise = streams.rise(prediction, setting.response)
            noise = replace(noise, gain_error=as_large(rise, noise.gain_error, episode))
        return Whitener(course.reduced, noise, self.context, features, errors, self.whitener)

    def whiteners(self, setting: Setting, fewer: Course) -> tuple[Whitener, Whitener]:
        """Return the cleaners of columns of all rows read, and of fewer rows.

        Args:
            setting: With the model's response and effects, and all readings.
            fewer: The course with those that the noise was estimated from.
        """
        course, response, placed = setting.course, setting.response, list(setting.given)
        reduced, streams, prediction = course.reduced, Streams.of(course), predict(course, response, placed)
        residual = streams.measured(course) - streams.predicted(prediction)
        rise = streams.rise(prediction, response).astype(np.float32)
        missing, noise, process = ~np.isfinite(residual), self.noise, self.noise.offsets
        noise = replace(
            noise,
            gain_error=(rise * self.spread).astype(np.float32),
            missing=missing if missing.any() else None,
            random_walk=_together(
                offset_random_walk.modes(noise.walk_rate, reduced, noise.memory),
                table_error.modes(response.error, rise, noise.scale, reduced),
            ),
            relative_scale=None if noise.relative_scale is None else readings.relative_scale(residual, rise, reduced),
            offsets=process and process.beside(reduced),
        )
        errors = pose_errors(setting, placed, prediction) * (1.0 if self.sizes is None else self.sizes)
        context, features = contexts(reduced), taken_up(course, response, placed)
        open_rows = np.isin(course.read, fewer.read)
        shared = None if features is None else features[open_rows]
        open_whitener = Whitener(fewer.reduced, noise.of(open_rows), context[open_rows], shared, errors[open_rows])
        return Whitener(reduced, noise, context, features, errors), open_whitener

    def projected_draws(self, whitener: Whitener) -> np.ndarray:
        """Return the cleaned draws [noise scales], shape (m, streams, draws), float32."""
        return self._shaken if whitener is self.whitener else whitener.projected(self.draws)

    @cached_property
    def _shaken(self) -> np.ndarray:
        return self.whitener.projected(self.draws)


def as_large(shape: np.ndarray, reference: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Rescale one model's pose (or gain) error columns to the per-episode norms of another's.

    Pose: shape (m, streams, kinds), the size of each kind over all streams. Gains: shape (m, streams), that of each.

    Args:
        shape: In the one model.
        reference: In the other.
        episode: Of each row, shape (m,), int64.
    """
    axes = 1 if reference.ndim == 3 else ()
    sizes = np.zeros((2, int(episode.max()) + 1, reference.shape[-1]))
    for size, values in zip(sizes, (shape, reference), strict=True):
        np.add.at(size, episode, np.square(values, dtype=float).sum(axis=axes))
    by = np.sqrt(sizes[1] / np.maximum(sizes[0], 1e-300))[episode]
    return (shape * (by[:, None] if reference.ndim == 3 else by)).astype(np.float32)


def _together(*modes: np.ndarray | None) -> np.ndarray | None:
    """Return modes of several causes, each shape (m, modes), side by side; None for none."""
    present = [columns for columns in modes if columns is not None]
    return np.concatenate(present, axis=1) if present else None


def null_model(setting: Setting) -> NullModel:
    """Estimate noise and nuisances of a model without further effects."""
    course, response = setting.course, setting.response
    reduced, streams = course.reduced, Streams.of(course)
    predicted = predict(course, response, list(setting.given))
    context, features = contexts(reduced), taken_up(course, response, setting.given)
    errors = pose_errors(setting, setting.given)
    extra, ridge = nuisance_columns(setting, setting.given)
    rich = generic(course, response, list(setting.given))
    residual = streams.measured(course) - streams.predicted(predicted)
    # Noise is estimated from the residual of a fit that is richer than any effect: else a missing effect would be taken
    # for noise.
    clock = slow(course, response, list(setting.given))
    candidates = np.concatenate([extra, rich, clock], axis=2, dtype=np.float32)
    rise = streams.rise(predicted, response).astype(np.float32)
    measured = EpisodeErrors(residual, candidates, reduced, context, features, rise)
    noise = measured.noise(errors)
    table_modes = table_error.modes(response.error, rise, noise.scale, reduced)
    noise = replace(noise, random_walk=_together(noise.random_walk, table_modes))
    unexplained = measured.left(noise, errors)
    prior, error_sizes = (
        errors,
        ErrorSizes(np.ones(errors.shape[2]), np.zeros(0, dtype=np.int64), np.ones(reduced.episodes)),
    )
    last_sizes, spread = np.zeros(errors.shape[2] + 1), LEAST_GAIN_ERROR
    for turn in range(ROUNDS):
        # Errors of pose and of gain explain much of the same: each is estimated given the other.
        noise = replace(noise, gain_error=None)
        spread = measured.gains(noise, errors, unexplained)
        noise = replace(noise, gain_error=(rise * max(spread, LEAST_GAIN_ERROR)).astype(np.float32))
        error_sizes = measured.poses(noise, prior, unexplained)
        if turn == 0 and error_sizes.counts.min() < ODD:
            # The fit bends to follow an outlying episode, and moves its residual to its neighbours.
            unexplained = measured.left(noise, prior * error_sizes.sizes, error_sizes.counts)
            error_sizes = measured.poses(noise, prior, unexplained)
        errors = prior * error_sizes.sizes
        new_sizes = np.array([*error_sizes.sizes, max(spread, LEAST_GAIN_ERROR)])
        if np.all(np.abs(new_sizes - last_sizes) <= SETTLED * new_sizes):
            break
        last_sizes = new_sizes
    whitener = Whitener(reduced, noise, context, features, errors)
    columns = whitener.whitened(candidates[:, :, : extra.shape[2] + rich.shape[2]])
    folds = fold_of(course.episodes)
    return NullModel.of(
        reduced,
        context,
        features,
        errors,
        ridge,
        columns,
        noise,
        folds,
        whitener,
        error_sizes.odd,
        error_sizes.sizes,
        max(spread, LEAST_GAIN_ERROR),
    )
