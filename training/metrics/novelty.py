"""Novelty of readings: how far they lie from the training data, for readings without a label to score by.

A network predicts something for any readings. Far from its training data no score holds. A few hundred training frames
are kept: each next one is the frame farthest from all chosen so far (T. F. Gonzalez, Theoretical Computer Science 38
(1985) 293). Presses left out set the scale: their readings count as near.

Distances are Euclidean between square roots of readings (with their signs), so that a weak contact counts too. Single
frames are compared, not windows: a movement that is new passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.training.frames.frames import Frames
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD

FILE = "seen.json"
KEPT = 400
"""Readings that stand for all others [count]."""
LOOKED_AT = 20_000
"""Training frames among which they are chosen, evenly taken [count]."""
SHARE = 0.99
"""Share of the frames in contact of presses left out that count as near [1]."""
FEWEST = 20
"""Such frames needed for a result [count]."""
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class TrainingReadings:
    """Readings that cover a network's training data, and the distance that counts as far."""

    readings: np.ndarray
    """Tared readings that stand for the training frames [counts], shape (k, taxels)."""
    far: float
    """Distance from the nearest of them within which `SHARE` of the validation frames in contact lie [counts^0.5]."""
    checkpoint: str
    """SHA-256 of the checkpoint that it belongs to."""

    def novelty(self, taxels: np.ndarray) -> np.ndarray:
        """Return the distance of readings from the training data over `far` [1], shape (m,).

        Above 1 they are farther than nearly all readings on which the network was validated.

        Args:
            taxels: Tared readings [counts], shape (m, taxels); where one is no number, the result is NaN.
        """
        return _nearest(_root(taxels), _root(self.readings)) / self.far

    @property
    def document(self) -> dict[str, Any]:
        """These readings as plain data (`schemas/seen.schema.json`)."""
        return {
            "version": schemas.version("seen"),
            "checkpoint": self.checkpoint,
            "far": self.far,
            "share": SHARE,
            "readings": np.round(self.readings, 1).tolist(),
            "provenance": provenance.stamp("training.metrics.novelty", {"checkpoint": self.checkpoint}, {"kept": KEPT}),
        }


def gathered(
    frames: Frames, parts: Sequence[tuple[np.ndarray, np.ndarray]], checkpoint: str, mirror: bool = False
) -> TrainingReadings | None:
    """Choose readings that cover the training data; None if the presses left out have too little contact.

    Args:
        frames: The dataset.
        parts: Numbers of the frames that were learned from, shape (m,), and of those left out then, shape (q,). Of
            several parts, as of a cross-fit, all frames learned from are covered.
        checkpoint: SHA-256 of the checkpoint.
        mirror: Whether training mirrored its frames.
    """
    distances, representatives = [], np.empty((0, frames.taxels.shape[1]))
    for learned, left_out in parts:
        pressed = left_out[frames.depth[left_out].max(axis=(1, 2)) > CONTACT_THRESHOLD]
        representatives = _representatives(frames, learned, mirror)
        # Square roots, as noise and gains scatter in proportion: without them deep presses alone would decide.
        distances.append(_nearest(_root(frames.taxels[pressed]), _root(representatives)))
    distance = np.concatenate(distances) if distances else np.empty(0)
    if len(distance) < FEWEST or not len(representatives):
        return None
    if len(parts) > 1:
        representatives = _representatives(frames, np.unique(np.concatenate([learned for learned, _ in parts])), mirror)
    return TrainingReadings(representatives, max(float(np.quantile(distance, SHARE)), 1e-6), checkpoint)


def write(run: Path, readings: TrainingReadings) -> None:
    """Write RUN/seen.json; an older one is replaced, as it belongs to an older checkpoint."""
    documents.write(run / FILE, readings.document, "seen")


def read(run: Path, checkpoint: str) -> TrainingReadings | None:
    """Return the training readings of a run's checkpoint; None if the run has none for it.

    Raises:
        FormatError: If the file is damaged.
    """
    if not (run / FILE).is_file():
        return None
    document = documents.read(run / FILE, "seen")
    if document["checkpoint"] != checkpoint:
        return None
    return TrainingReadings(np.array(document["readings"], float), float(document["far"]), checkpoint)


def _root(taxels: np.ndarray) -> np.ndarray:
    values = np.asarray(taxels, np.float64)
    return np.sign(values) * np.sqrt(np.abs(values))


def _nearest(points: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """Return the distance of each point, shape (m, d), from the nearest known one, shape (k, d)."""
    distances = np.empty(len(points))
    squares = (readings**2).sum(axis=1)
    for start in range(0, len(points), BLOCK):
        block = points[start : start + BLOCK]
        square = (block**2).sum(axis=1)[:, None] + squares - 2 * block @ readings.T
        # By rounding the square of a distance near zero may be negative.
        distances[start : start + BLOCK] = np.sqrt(np.maximum(square.min(axis=1), 0.0))
    return distances


def _covering(points: np.ndarray) -> np.ndarray:
    """Return the rows of at most `KEPT` points, shape (n, d), each the farthest from those before it."""
    selection, distance = [0], np.full(len(points), np.inf)
    while len(selection) < min(KEPT, len(points)):
        distance = np.minimum(distance, ((points - points[selection[-1]]) ** 2).sum(axis=1))
        selection.append(int(distance.argmax()))
    return np.array(selection)


def _representatives(frames: Frames, learned: np.ndarray, mirror: bool) -> np.ndarray:
    """Return readings that cover the frames learned from [counts], shape (k, taxels)."""
    readings = frames.taxels[learned[:: -(-len(learned) // LOOKED_AT)]].astype(np.float64)
    if mirror:
        readings = np.concatenate(_mirrored(readings, frames.sensor.taxels.rows, frames.sensor.taxels.columns))
    # Rounded as in the file: a checkpoint that is read again must judge readings the same way.
    return np.round(readings[_covering(_root(readings))], 1)


def _mirrored(taxels: np.ndarray, rows: int, columns: int) -> list[np.ndarray]:
    """Return readings, shape (n, taxels), mirrored in no, one, the other and both directions (taxel i + columns j)."""
    grid = taxels.reshape(-1, rows, columns)
    return [grid[:, ::j, ::i].reshape(len(taxels), -1) for j in (1, -1) for i in (1, -1)]
