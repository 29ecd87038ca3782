"""Whitened residual of each press, without nuisances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.chain import Course, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.whitener import whiten
from tacdata.discrepancy.search.fits import fitted
from tacdata.discrepancy.search.problem import Problem

TABLE_ERROR = 0.0002
"""A part of a smaller share of the rise may be interpolation error of a table [1]."""
SPLINE_ERROR = 0.0005
"""The same for a fitted response, whose slope and bends are inexact [1]."""
MOST_CLUSTERS = 200
"""Of more presses, successive ones are taken together."""


@dataclass(frozen=True)
class Cleaned:
    """Residual of a model, of the rows read."""

    problem: Problem
    residual: np.ndarray
    """Whitened, without nuisances, of channels alone [noise scales], shape (m, channels), float64."""
    rise: np.ndarray
    """Rise of each channel under presses [its unit], shape (m, channels)."""
    speed: np.ndarray
    """Rate of depth [mm/s], shape (m,)."""
    begins: np.ndarray
    """First row of each press that was read, shape (presses,), int64."""
    episodes: np.ndarray
    """Its episode, shape (presses,), int64."""
    noise: Noise
    """Of channels alone."""
    form_error: float = 0.0
    """Model error of its effects' forms, as half a whitened sum of squares [1]."""

    @classmethod
    def of(cls, problem: Problem, form_error: float = 0.0) -> Cleaned:
        """Return the residual of a problem's model, with the model error of its effects' forms."""
        null, setting = problem.null, problem.setting
        course, placed = setting.course, [*setting.given, *problem.placed]
        whitener = null.whitener_for(setting, placed)
        residual = whitener.whitened(problem.board.columns[0][:, :, None])[:, :, 0]
        if len(problem.nuisances):
            values = fitted(problem, [])
            residual = residual - null.nuisances @ values[-len(problem.nuisances) :].astype(np.float32)
        channels, noise, streams = course.channels, null.noise, Streams.of(course)
        rise = streams.rise(predict(course, setting.response, placed), setting.response)[:, :channels]
        episode = course.reduced.episode
        begins = np.flatnonzero(np.diff(episode, prepend=-1))
        relative = None if noise.relative_scale is None else noise.relative_scale[:, :channels]
        missing = None if noise.missing is None else noise.missing[:, :channels]
        channel_noise = Noise(
            noise.scale[:channels], noise.memory, noise.step, relative_scale=relative, missing=missing
        )
        return cls(
            problem,
            residual[:, :channels].astype(float),
            rise,
            course.speed[course.read],
            begins,
            episode[begins],
            channel_noise,
            form_error,
        )

    @property
    def course(self) -> Course:
        """With the rows read alone."""
        return self.problem.setting.course.reduced

    @property
    def largest(self) -> float:
        """Largest rise of a channel [its unit]."""
        return max(float(np.abs(self.rise).max(initial=0.0)), 1e-12)

    @property
    def least(self) -> float:
        """Model error of the response itself, as a sum of squares [1]: less is no alarm."""
        share = SPLINE_ERROR if self.problem.setting.response.fitted else TABLE_ERROR
        return float((share * self.problem.rise) ** 2)

    @property
    def least_of_channels(self) -> float:
        """The same for single channels. None creeps by quite the law of another."""
        return max(self.least, 2 * self.form_error)

    def whitened(self, column: np.ndarray) -> np.ndarray:
        """Return a column of each channel (m, channels) as noise is whitened, without a press's own errors."""
        return whiten(column[:, :, None], self.course, self.noise)[:, :, 0].astype(float)

    def without_mean(self, values: np.ndarray) -> np.ndarray:
        """Return values (m, k) without the mean over each press: its own offset is free."""
        count = np.diff(self.begins, append=len(values))
        mean = np.add.reduceat(values, self.begins, axis=0) / count[:, None]
        return values - np.repeat(mean, count, axis=0)

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return sums over presses, successive ones together where they are many, shape (clusters, channels)."""
        each = np.add.reduceat(values, self.begins, axis=0)
        count = len(each)
        if count <= MOST_CLUSTERS:
            return each
        return np.add.reduceat(each, np.arange(MOST_CLUSTERS) * count // MOST_CLUSTERS, axis=0)
