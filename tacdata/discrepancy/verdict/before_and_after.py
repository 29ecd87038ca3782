"""Readings, and predictions of a verdict's model without and with its effects."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.search.findings import Findings
from tacdata.discrepancy.verdict.calibration import gains_beyond_calibration
from tacdata.discrepancy.verdict.residual_slices import PHASES, phases
from tacdata.discrepancy.verdict.residual_table import Residuals

MOST_VALUES = 2_000_000
"""Values of each kind in the file; of more, every second, third, ... reading is kept."""


def beside_model(course: Course, found: Findings, sealed: np.ndarray, most: int = MOST_VALUES) -> Residuals:
    """Return the readings with the predictions of the model before and after.

    Args:
        course: All recordings, the sealed ones with their readings.
        found: Findings without those.
        sealed: Which episodes were sealed.
        most: Values of each kind that are kept at most.
    """
    streams, reduced, first, last = Streams.of(course), course.reduced, found.problem, found.final
    measured = streams.measured(course)
    before = streams.predicted(predict(course, first.setting.response, list(first.setting.given)))
    placed = [*last.setting.given, *last.placed, *(f.placed for f in gains_beyond_calibration(found))]
    after = streams.predicted(predict(course, last.setting.response, placed))
    scale = first.null.noise
    every = max(int(np.ceil(measured.size / most)), 1)
    kept = slice(None, None, every)
    return Residuals(
        episode=reduced.episode[kept].astype(np.int32),
        time=reduced.time[kept],
        phase=phases(reduced)[kept].astype(np.int8),
        depth=reduced.tip[kept, 2].astype(np.float32),
        rate=reduced.speed[kept].astype(np.float32),
        measured=measured[kept].astype(np.float32),
        before=_level(measured, before, reduced.episode)[kept].astype(np.float32),
        after=_level(measured, after, reduced.episode)[kept].astype(np.float32),
        # From the innovations of an AR(1) process to the standard deviation of readings.
        noise=scale.scale / np.sqrt(max(1 - scale.memory**2, 0.02)),
        streams=streams.names(course),
        phases=PHASES,
        names=course.names,
        sealed=tuple(int(k) for k in sealed),
        every=every,
    )


def _level(measured: np.ndarray, predicted: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Return predictions moved by the median residual of each episode: offsets are nuisances."""
    result = predicted.copy()
    for number in np.unique(episode):
        own = episode == number
        deviation = measured[own] - predicted[own]
        known = np.isfinite(deviation).any(axis=0)
        result[np.ix_(own, known)] += np.nanmedian(deviation[:, known], axis=0)
    return result
