"""Nuisances of recordings: calibration, an episode's own errors, a recording's set-up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain import Prediction, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise import table_error
from tacdata.discrepancy.regressors.candidates import build
from tacdata.discrepancy.regressors.generic import depth_slope
from tacdata.discrepancy.regressors.stack import side_by_side
from tacdata.effects import Placed, library, load

IDLE = 0.01
"""Prior standard deviation of a reading without load [largest rise]."""
POSE_PRIOR = (0.02, 0.02, 0.01)
"""Prior standard deviations of an episode's errors of x, y and depth, with a table [mm]."""
FITTED_DEPTH_PRIOR = 0.01
"""The same for the depth with a fitted response [stroke]."""
FITTED_GAIN_PRIOR = 0.01
"""Prior standard deviation of an episode's gain with a fitted response [1]."""
SET_UP_FACTOR = 2.0
"""Prior of a recording's set-up error over that of an episode's error [1]."""
MOST_SET_UPS = 24
"""With more recordings, set-up errors are left to the episodes' own."""


def nuisance_columns(setting: Setting, placed: Sequence[Placed]) -> tuple[np.ndarray, np.ndarray]:
    """Return the nuisances' columns (n, streams, k) and the weights of their priors (k,).

    Calibration's (a gain of each channel, then the known state of each without load) and a table's error, unless the
    response is fitted; then the offsets between recordings of several strokes.
    """
    course, response = setting.course, setting.response
    if response.fitted:
        return set_ups(setting, placed)
    effects = [load(name) for name in setting.nuisance]
    board = build(course, response, placed, effects)
    idle = np.zeros((len(course.read), board.columns[0].shape[1], course.channels), dtype=np.float32)
    rise = Streams.of(course).rise(predict(course, response, placed), response)
    largest = float(np.abs(rise[:, : course.channels]).max())
    idle[:, np.arange(course.channels), np.arange(course.channels)] = IDLE * largest
    load_errors = table_error.common(response.error, rise, course.reduced)
    weights = [
        # A column is the change by a typical size: a standard deviation s has the weight (typical / s)^2.
        (p.typical / setting.nuisance[c.effect.name]) ** 2
        for c in board.candidates
        for p in c.effect.amplitudes
        for _ in range(len(c.columns) // len(c.effect.amplitudes))
    ]
    set_up_columns, ridge = set_ups(setting, placed)
    columns = np.concatenate([side_by_side(board.columns)[:, :, 1:], idle, load_errors, set_up_columns], axis=2)
    return columns, np.array([*weights, *np.ones(course.channels + load_errors.shape[2]), *ridge])


def set_ups(setting: Setting, placed: Sequence[Placed]) -> tuple[np.ndarray, np.ndarray]:
    """Return columns of the offsets between recordings of several strokes (n, streams, k), and weights (k,).

    A recording is set up once: its strokes share errors of pose and gain, which are no drift from one to the next.
    """
    pose_columns = pose_errors(setting, placed)
    recording = setting.course.recording
    if recording is None or not 1 < recording.max() + 1 <= MOST_SET_UPS:
        return np.zeros((*pose_columns.shape[:2], 0), dtype=np.float32), np.zeros(0)
    of = recording[setting.course.reduced.episode]
    each = [SET_UP_FACTOR * pose_columns * (of == number)[:, None, None] for number in range(recording.max() + 1)]
    columns = np.concatenate(each, axis=2, dtype=np.float32)
    return columns, np.ones(columns.shape[2])


def pose_errors(setting: Setting, placed: Sequence[Placed], predicted: Prediction | None = None) -> np.ndarray:
    """Return the effect of an episode's own errors of pose, at one standard deviation, shape (n, streams, kinds).

    Args:
        setting: With the model's response.
        placed: Its effects.
        predicted: Its prediction, where that is known already.
    """
    course, response = setting.course, setting.response
    slope = depth_slope(course, response, list(placed))
    if response.fitted:
        # Where the response follows the readings, gains are as much each episode's own as depths.
        rise = Streams.of(course).rise(predicted or predict(course, response, list(placed)), response)
        rise[:, course.channels :] = 0.0
        return np.stack([slope * FITTED_DEPTH_PRIOR * course.stroke, rise * FITTED_GAIN_PRIOR], axis=2)
    parts = [slope[:, :, None] * POSE_PRIOR[2]]
    for effect in (e for e in library() if e.each_episode):
        board = build(course, response, placed, [effect])
        if board.candidates:
            shift = board.candidates[0].effect.amplitudes[0].typical
            parts.append(side_by_side(board.columns)[:, :, 1:] * (POSE_PRIOR[0] / shift))
    return np.concatenate(parts, axis=2)
