"""Baselines of the scores: predictors without a network, fitted on the training frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tacdata.training.frames.frames import Frames
from tacdata.training.splits.split import Split

RIDGE = 1e-3
"""Ridge of the linear predictor, as a share of the mean variance of the signals [1]."""


def predictions(frames: Frames, split: Split, indices: np.ndarray) -> dict[str, np.ndarray]:
    """Return each baseline's maps [mm], (m, pixels_x, pixels_y), of the frames ``indices`` (m,).

    ``mean`` answers with the mean training label; ``linear`` regresses each pixel on the taxels of the one
    frame, with a small ridge. Both are clipped to 0 ... D_max like a network's maps.
    """
    learned = frames.indices(split.train)
    top = frames.sensor.map.depth_max
    signals = frames.taxels[learned].astype(np.float64)
    offset = signals.mean(axis=0)
    signals -= offset
    covariance = signals.T @ signals / len(learned)
    # In proportion to the readings' power, so that the unit of the readings does not matter.
    ridge = RIDGE * np.trace(covariance) / len(covariance) + 1e-12
    mean, cross = _moments(frames, learned, signals)
    slope = np.linalg.solve(covariance + ridge * np.eye(len(covariance)), cross / len(learned))
    linear = (frames.taxels[indices] - offset) @ slope + mean
    shape = (len(indices), *frames.sensor.map.shape)
    maps = {"mean": np.broadcast_to(mean, (len(indices), len(mean))), "linear": linear}
    return {name: np.clip(values, 0.0, top).reshape(shape).astype(np.float32) for name, values in maps.items()}


def ahead(document: Mapping[str, Any], larger: tuple[str, ...] = ("iou",)) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the medians in which a baseline is better than the network: by baseline and metric, its and the network's.

    Args:
        document: Scores (`schemas/scores.schema.json`).
        larger: Metrics of which the larger value is the better one.
    """
    better_baselines: dict[str, dict[str, tuple[float, float]]] = {}
    for name, table in document["baselines"].items():
        for metric, values in table.items():
            its, score = values["median"], document["contact_frames"][metric]["median"]
            # Where the network sees no contact in any frame, it has no centroid at all.
            better = its is not None and (score is None or (its > score if metric in larger else its < score))
            if better:
                better_baselines.setdefault(name, {})[metric] = its, float("nan") if score is None else score
    return better_baselines


def _moments(frames: Frames, learned: np.ndarray, signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean label [mm] (pixels,) and the sum of signals times labels (taxels, pixels)."""
    pixels = int(np.prod(frames.sensor.map.shape))
    total, cross = np.zeros(pixels), np.zeros((signals.shape[1], pixels))
    for start in range(0, len(learned), 4096):
        part = frames.depth[learned[start : start + 4096]].reshape(-1, pixels).clip(0.0, frames.sensor.map.depth_max)
        total += part.sum(axis=0, dtype=np.float64)
        cross += signals[start : start + 4096].T @ part
    return total / len(learned), cross
