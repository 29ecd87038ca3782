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


def beside_model(course: Course, findings: Findings, sealed: np.ndarray, value_limit: int = MOST_VALUES) -> Residuals:
    """Return the readings with the predictions of the model before and after.

    Args:
        course: All recordings, the sealed ones with their readings.
        findings: Findings without those.
        sealed: Which episodes were sealed.
        value_limit: Values of each kind that are kept at most.
    """
    streams, reduced, first, last = Streams.of(course), course.reduced, findings.problem, findings.final
    measured = streams.measured(course)
    base_prediction = streams.predicted(predict(course, first.setting.response, list(first.setting.given)))
    placed = [*last.setting.given, *last.placed, *(f.placed for f in gains_beyond_calibration(findings))]
    final_prediction = streams.predicted(predict(course, last.setting.response, placed))
    scale = first.null.noise
    stride = max(int(np.ceil(measured.size / value_limit)), 1)
    rows = slice(None, None, stride)
    return Residuals(
        episode=reduced.episode[rows].astype(np.int32),
        time=reduced.time[rows],
        phase=phases(reduced)[rows].astype(np.int8),
        depth=reduced.tip[rows, 2].astype(np.float32),
        rate=reduced.speed[rows].astype(np.float32),
        measured=measured[rows].astype(np.float32),
        before=_level(measured, base_prediction, reduced.episode)[rows].astype(np.float32),
        after=_level(measured, final_prediction, reduced.episode)[rows].astype(np.float32),
        # From the innovations of an AR(1) process to the standard deviation of readings.
        noise=scale.scale / np.sqrt(max(1 - scale.memory**2, 0.02)),
        streams=streams.names(course),
        phases=PHASES,
        names=course.names,
        sealed=tuple(int(k) for k in sealed),
        every=stride,
    )


def _level(measured: np.ndarray, predicted: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Return predictions moved by the median residual of each episode: offsets are nuisances."""
    result = predicted.copy()
    for number in np.unique(episode):
        rows = episode == number
        deviation = measured[rows] - predicted[rows]
        columns = np.isfinite(deviation).any(axis=0)
        result[np.ix_(rows, columns)] += np.nanmedian(deviation[:, columns], axis=0)
    return result
