"""Conformal intervals of each predicted pixel, calibrated on the validation episodes, for any network.

The error of a depth map is largest at the contact's edge and where it is deep. So each pixel falls into a cell, by its
predicted depth and by the depth's slope there. Conformal prediction (Angelopoulos and Bates, 2023) takes two steps:

1. The validation episodes give each cell its standard deviation, the root mean square error. A cell with few pixels
   takes that of all cells of its depth.
2. The errors of each episode are divided by deviations that the other episodes give (cross-conformal prediction;
   V. Vovk, Annals of Mathematics and Artificial Intelligence 74 (2015) 9). The factor of a level is the quotient below
   which such a share of them is.

Whole episodes are left out, because frames of one press have correlated errors. The intervals hold for presses like
those of validation. Away from the presses that were learned from, they are wider: errors are divided by a power of the
deviation of the network's Gaussian process (`training.frames.peak_process`) too. So the scores are normalized ones
(H. Papadopoulos et al., Journal of Artificial Intelligence Research 40 (2011) 815).

A network fitted from another one has few presses of validation. There `adapted` scales the other one's intervals by the
ratio of both errors on these presses (`training.completion`).

`training.pretraining.unseen_shapes` calibrates on shapes left out of training instead. `reliability` measures the share
inside on the scored episodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD

FILE = "spread.json"
VALIDATION = "validation episodes"
"""Default calibration data of intervals."""
LEVELS = (0.5, 0.68, 0.8, 0.9, 0.95, 0.99)
"""Shares of errors for which intervals are calibrated [1]."""
DEPTHS = (0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5)
"""Borders of the cells in predicted depth [mm]."""
SLOPES = (0.02, 0.1, 0.3, 0.6, 1.0)
"""Borders of the cells in slope [mm/mm]."""
LEAST = 200
"""Pixels that a cell needs for a deviation of its own."""
NOT_KNOWN = 1e9
"""Factor where nothing is known: an interval that holds everything."""
EXPONENT = 1.5
"""Power of the Gaussian process's deviation in that of a pixel [1]; chosen on rigs 30 and 31 with 8 and 96 presses.

Place and shape err with the maximum, so that a pixel's error grows faster than the maximum's."""
FLOOR = 1e-4
"""Smallest deviation [mm]."""
SCATTER = 4
"""Presses whose ratio of two predictors' errors is believed by half [count]; chosen on rigs 30 and 31 with 30 presses.

The ratio of few presses scatters, and they chose the epoch of the fitted network too."""
_PARTS = 40
"""Parts of the episodes at most; each is left out once [count]."""


@dataclass(frozen=True)
class ConformalIntervals:
    """Standard deviation by cell, and the factors of it that make intervals of each level."""

    deviation: np.ndarray
    """Root mean square error [mm], shape (len(DEPTHS) + 1, len(SLOPES) + 1)."""
    factors: tuple[float, ...]
    """Deviations that contain each share of `LEVELS` [1]."""
    checkpoint: str
    """SHA-256 of the checkpoint that it belongs to."""
    source: str = VALIDATION
    """Calibration data, as a phrase."""
    typical: float | None = None
    """Median deviation of the Gaussian process on the calibration data in contact [1]; None without a process."""

    @property
    def definition(self) -> str:
        """Unit of `reliability`, as a phrase."""
        return (
            f"share of errors inside intervals calibrated on {self.source}, over pixels deeper than 0.1 mm in label or "
            "prediction"
        )

    def sigma(self, depth: np.ndarray, pitch: float, spread: np.ndarray | None = None) -> np.ndarray:
        """Return the standard deviation of each pixel [mm], same shape as ``depth``.

        Args:
            depth: Predicted maps [mm], shape (n, pixels_x, pixels_y).
            pitch: Distance of pixels [mm].
            spread: Deviation of the network's Gaussian process [1], shape (n,) (`inference.predictor.deviations`).

        Raises:
            UsageError: If the intervals need the spread and there is none.
        """
        deviation = self.deviation[cells(depth, pitch)]
        if self.typical is None:
            return deviation
        if spread is None:
            raise UsageError(
                "maps without the deviation of the network's Gaussian process",
                "one value a map: these intervals are scaled by it",
                "take it from tacdata.training.inference.predictor.deviations",
            )
        return deviation * ((spread / self.typical) ** EXPONENT)[:, None, None]

    def half_width(self, depth: np.ndarray, pitch: float, level: float, spread: np.ndarray | None = None) -> np.ndarray:
        """Return half the width of a level's interval [mm], same shape as ``depth``.

        Raises:
            UsageError: If the level is none of `LEVELS`.
        """
        if level not in LEVELS:
            raise UsageError(f"level {level}", ", ".join(map(str, LEVELS)), "choose one of them")
        return self.factors[LEVELS.index(level)] * self.sigma(depth, pitch, spread)

    def adapted(
        self,
        maps: list[np.ndarray],
        others: list[np.ndarray],
        labels: list[np.ndarray],
        spreads: list[np.ndarray],
        pitch: float,
    ) -> ConformalIntervals:
        """Return intervals of a second predictor, by the errors of both on presses that neither learned from.

        Args:
            maps: Maps of the second predictor [mm], as of `calibrate`.
            others: Maps of the predictor that these intervals are of [mm], same shapes.
            labels: As of `calibrate`, like ``spreads`` and ``pitch``.
            spreads: Deviations for each press.
            pitch: Distance of pixels [mm].
        """
        quotients = [
            np.concatenate(
                [
                    (np.abs(depth - label) / self.sigma(depth, pitch, spread))[_interesting(depth, label)]
                    for depth, label, spread in zip(some, labels, spreads, strict=True)
                ]
            )
            for some in (maps, others)
        ]
        if not all(map(len, quotients)):
            return self
        second, first = (np.quantile(some, LEVELS).clip(FLOOR) for some in quotients)
        ratio = (second / first) ** (len(maps) / (len(maps) + SCATTER))
        return replace(self, factors=tuple(float(factor) for factor in self.factors * ratio))

    @property
    def document(self) -> dict[str, Any]:
        """The calibration as plain data (`schemas/spread.schema.json`)."""
        return {
            "version": schemas.version("spread"),
            "checkpoint": self.checkpoint,
            "calibrated_on": self.source,
            "depths": list(DEPTHS),
            "slopes": list(SLOPES),
            "deviation": self.deviation.tolist(),
            "levels": list(LEVELS),
            "factors": list(self.factors),
            **({"typical": self.typical} if self.typical is not None else {}),
            "provenance": provenance.stamp("training.metrics.conformal_intervals", {"checkpoint": self.checkpoint}, {}),
        }


def cells(depth: np.ndarray, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the cell of each pixel: by depth and by slope, both of the shape of ``depth`` [mm], int64."""
    along_x, along_y = np.gradient(depth, pitch, axis=(1, 2))
    return np.digitize(depth, DEPTHS), np.digitize(np.hypot(along_x, along_y), SLOPES)


def calibrate(
    maps: list[np.ndarray],
    labels: list[np.ndarray],
    pitch: float,
    checkpoint: str,
    source: str = VALIDATION,
    spreads: list[np.ndarray] | None = None,
) -> ConformalIntervals:
    """Calibrate on episodes that the network did not learn from.

    Args:
        maps: Predicted maps of each episode [mm], shape (n, pixels_x, pixels_y).
        labels: Their labels [mm], same shapes.
        pitch: Distance of pixels [mm].
        checkpoint: SHA-256 of the checkpoint.
        source: Description of the episodes.
        spreads: Deviations of the network's Gaussian process for each episode [1], shapes (n,); None without one.

    Raises:
        UsageError: If there are fewer than two episodes.
    """
    if len(maps) < 2:
        raise UsageError(f"{len(maps)} validation episodes", "two or more, to calibrate intervals", "record more")
    parts = np.arange(len(maps)) % min(len(maps), _PARTS)
    masks = [_interesting(depth, label) for depth, label in zip(maps, labels, strict=True)]
    typical, units = None, [np.ones(len(depth)) for depth in maps]
    if spreads is not None:
        touching = [s[mask.any(axis=(1, 2))] for s, mask in zip(spreads, masks, strict=True)]
        typical = float(np.median(np.concatenate(touching))) if any(map(len, touching)) else 1.0
        units = [(s / typical) ** EXPONENT for s in spreads]
    episode_sums = [_sums(*episode, pitch) for episode in zip(maps, labels, units, strict=True)]
    sums = [
        np.sum([episode_sum for episode_sum, at in zip(episode_sums, parts, strict=True) if at == part], axis=0)
        for part in range(parts.max() + 1)
    ]
    total = np.sum(sums, axis=0)
    deviation, quotients = _filled(*total), []
    for k, (depth, mask) in enumerate(zip(maps, masks, strict=True)):
        # Each press is judged by deviations of the others: by its own, intervals would be too narrow.
        sigma = _filled(*(total - sums[parts[k]]))[cells(depth, pitch)] * units[k][:, None, None]
        quotients.append((np.abs(depth - labels[k]) / sigma)[mask])
    together = np.concatenate(quotients)
    # Where nothing touched there is nothing to calibrate on, and the widest claim is the honest one.
    factors = tuple(float(q) for q in np.quantile(together, LEVELS)) if len(together) else (NOT_KNOWN,) * len(LEVELS)
    return ConformalIntervals(deviation, factors, checkpoint, source, typical)


def _sums(depth: np.ndarray, label: np.ndarray, unit: np.ndarray, pitch: float) -> np.ndarray:
    """Return the squared errors over ``unit`` (n,) [mm^2] and the pixels of each cell, shape (2, depths, slopes)."""
    shape = (len(DEPTHS) + 1, len(SLOPES) + 1)
    place = np.ravel_multi_index(cells(depth, pitch), shape).reshape(-1)
    error = ((depth - label).astype(np.float64) / unit[:, None, None]).reshape(-1)
    return np.stack([np.bincount(place, w, minlength=shape[0] * shape[1]).reshape(shape) for w in (error**2, None)])


def reliability(
    intervals: ConformalIntervals,
    maps: list[np.ndarray],
    labels: list[np.ndarray],
    pitch: float,
    spreads: Sequence[np.ndarray | None] | None = None,
) -> list[dict[str, float | int]]:
    """Return for each level the share of errors inside its interval, over pixels in contact in label or prediction.

    Args:
        intervals: The calibration.
        maps: Predicted maps of each episode [mm], shape (n, pixels_x, pixels_y).
        labels: Their labels [mm], same shapes.
        pitch: Distance of pixels [mm].
        spreads: Deviations of the network's Gaussian process for each episode [1], shapes (n,); None without one.
    """
    inside, width, total = np.zeros(len(LEVELS)), np.zeros(len(LEVELS)), 0
    for depth, label, spread in zip(maps, labels, spreads or [None] * len(maps), strict=True):
        mask = _interesting(depth, label)
        sigma, error = intervals.sigma(depth, pitch, spread)[mask], np.abs(depth - label)[mask]
        for k, factor in enumerate(intervals.factors):
            inside[k] += (error <= factor * sigma).sum()
            width[k] += (2 * factor * sigma).sum()
        total += int(mask.sum())
    return [
        {
            "level": level,
            "inside": float(inside[k] / total) if total else 0.0,
            "mean_width_mm": float(width[k] / total) if total else 0.0,
            "pixels": total,
        }
        for k, level in enumerate(LEVELS)
    ]


def write(run: Path, intervals: ConformalIntervals) -> None:
    """Write RUN/spread.json; an older one is replaced, as it belongs to an older checkpoint."""
    documents.write(run / FILE, intervals.document, "spread")


def read(run: Path, checkpoint: str) -> ConformalIntervals | None:
    """Return the calibration of a run's checkpoint; None if the run has none for it.

    Raises:
        FormatError: If the file is damaged.
    """
    path = run / FILE
    if not path.is_file():
        return None
    document = documents.read(path, "spread")
    deviation = np.array(document["deviation"])
    shape = (len(DEPTHS) + 1, len(SLOPES) + 1)
    same = (tuple(document[k]) for k in ("depths", "slopes", "levels"))
    if deviation.shape != shape or tuple(same) != (DEPTHS, SLOPES, LEVELS):
        raise FormatError(f"{path}: cells of another release", "cells of this release", "remove it and train again")
    if document["checkpoint"] != checkpoint:
        return None
    source = document.get("calibrated_on", VALIDATION)
    return ConformalIntervals(deviation, tuple(document["factors"]), checkpoint, source, document.get("typical"))


def _interesting(depth: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Return the pixels in contact in either map; elsewhere both are near zero, and any interval holds."""
    return (depth > CONTACT_THRESHOLD) | (label > CONTACT_THRESHOLD)


def _filled(square: np.ndarray, count: np.ndarray) -> np.ndarray:
    rows = square.sum(axis=1, keepdims=True) / np.maximum(count.sum(axis=1, keepdims=True), 1)
    enough = count.sum(axis=1) >= LEAST
    occupied = np.flatnonzero(enough)
    if not len(occupied):
        rows[:] = square.sum() / max(count.sum(), 1)
    for k in np.flatnonzero(~enough) if len(occupied) else ():
        # Depths that no press reached take the deviation of the nearest depth.
        rows[k] = rows[occupied[np.argmin(np.abs(occupied - k))]]
    mean_square = square / np.maximum(count, 1)
    return np.sqrt(np.where(count >= LEAST, mean_square, np.broadcast_to(rows, count.shape))).clip(FLOOR)
