"""Recordings corrected by named effects: times without the delay, the path as it was, readings without the rest."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tacdata.chain import predict
from tacdata.discrepancy.search.gauss_newton import Refined
from tacdata.effects import Placed
from tacdata.revision.comparison import Comparison

DIGITS = 8
"""Significant digits of a reading."""


def write_corrected(comparison: Comparison, model: Refined, path: Path) -> dict[str, str]:
    """Write readings as recorded and as corrected, a row a reading, as CSV; return a summary of the correction.

    A delay is taken off the times, a kinematic effect is put into the path. Of any other effect its contribution to
    the readings, as the model predicts it, is subtracted.

    Args:
        comparison: Recordings and the model before.
        model: The model with the effects.
        path: File to write.
    """
    course, rows = comparison.course, comparison.course.read
    delay = sum(p.effect.delay(p.values) for p in model.placed)
    kinematic = [p for p in model.placed if p.stage == "kinematics"]
    # A delay is an error of the times, not of the readings.
    delays = [p for p in model.placed if p.effect.delay(p.values) != 0]
    additive = [p for p in model.placed if p not in kinematic and p not in delays]
    prediction = predict(course, model.response, [*comparison.setting.given, *model.placed])
    changed: dict[str, str] = {}
    columns: list[tuple[str, np.ndarray]] = [("time_s", _since_start(comparison)[rows])]
    if delays:
        columns.append(("time_corrected_s", columns[0][1] - delay))
        changed["times"] = f"{_names(delays)}: {delay:.4g} s taken off"
    columns.append(("depth_mm", course.tip[rows, 2]))
    if kinematic:
        columns.append(("depth_corrected_mm", prediction.pose[rows, 2]))
        shift = float(np.abs(prediction.pose[rows, 2] - course.tip[rows, 2]).max())
        changed["path"] = f"{_names(kinematic)}: depth changed by up to {shift:.4g} mm"
    contribution = np.zeros((len(rows), course.channels))
    if additive:
        # What the additive effects contribute is the difference of two predictions, as effects act on each other.
        bare = predict(course, model.response, [*comparison.setting.given, *kinematic, *delays])
        contribution = (prediction.signal - bare.signal)[rows]
        changed["readings"] = f"{_names(additive)}: up to {float(np.abs(contribution).max()):.4g} subtracted"
    for k, name in enumerate(course.channel_names):
        columns.append((name.replace(" ", "_"), course.readings[rows, k]))
        if additive:
            columns.append((f"{name.replace(' ', '_')}_corrected", course.readings[rows, k] - contribution[:, k]))
    values = np.column_stack([column for _, column in columns])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["episode", *(name for name, _ in columns)])
        for episode, row in zip(course.episode[rows], values, strict=True):
            writer.writerow([course.names[episode], *(f"{v:.{DIGITS}g}" for v in row)])
    return changed


def _names(placed: Sequence[Placed]) -> str:
    return " and ".join(p.effect.spoken for p in placed)


def _since_start(comparison: Comparison) -> np.ndarray:
    """Return the time since the first row of each row's recording [s], shape (rows,)."""
    course = comparison.course
    recording = np.arange(course.episodes) if course.recording is None else course.recording
    of_row = recording[course.episode]
    # Strokes of one recording share its clock.
    start = np.array([course.time[np.argmax(of_row == k)] for k in range(int(recording.max()) + 1)])
    return course.time - start[of_row]
