"""Baselines of the scores: predictors without a network, fitted on the training frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tacdata.training.frames import ridge
from tacdata.training.frames.frames import Frames
from tacdata.training.splits.split import Split


def predictions(frames: Frames, split: Split, indices: np.ndarray) -> dict[str, np.ndarray]:
    """Return each baseline's maps [mm], (m, pixels_x, pixels_y), of the frames ``indices`` (m,).

    ``mean`` answers with the mean training label; ``linear`` regresses each pixel on the taxels of the one
    frame, with a small ridge. Both are clipped to 0 ... D_max like a network's maps.
    """
    top, products = frames.sensor.map.depth_max, ridge.products(frames, split.train)
    linear = ridge.predicted(frames.taxels[indices], ridge.regression(products))
    mean = products[0, frames.taxels.shape[1] + 1 :] / products[0, 0]
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
