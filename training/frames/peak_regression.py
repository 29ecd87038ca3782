"""Regression of a map's deepest pixel: by how much a network's maximum errs, from the map and the loads, per unit.

A network predicts the mean of each pixel. The maximum of means is not the mean of maxima, and the depth at a given load
depends on the unit's skin. So the logarithm of labelled over predicted maximum is regressed on a few quantities of map
and loads (`networks.network.peak_features`), on the training presses.

Ridge regression: each press weighs the same, each frame by its squared depth, as the error in millimetres counts. The
prior's mean is no correction, or that of the network from which this one was fitted: with few presses the coefficients
stay near it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from tacdata.training.frames.windows import Windows
from tacdata.training.networks.network import peak_features

if TYPE_CHECKING:
    from tacdata.training.frames.frames import Frames
    from tacdata.training.networks.network import Network

RIDGE = 0.3
"""Prior precision of a standardized coefficient [mm^2]; tuned on virtual rigs 20 and 21 with 3 to 96 presses."""
FEWEST = 6
"""Presses below which nothing is corrected [count]: with 3 presses the correction did harm on rig 20."""
LEAST = 0.06
"""Labelled maximum from which a frame counts [mm]: below, noise decides the region."""
FRAMES = 150
"""Frames of a press that are taken at most, evenly [count]."""


@dataclass(frozen=True)
class PeakRegression:
    """Correction of a map's maximum: coefficients on standardized features."""

    mean: np.ndarray
    """Mean of each feature over the presses [1], shape (features,)."""
    scale: np.ndarray
    """Standard deviation of each feature [1], shape (features,)."""
    weight: np.ndarray
    """Coefficients [1], shape (features + 1,): the constant first."""

    @property
    def document(self) -> dict[str, Any]:
        """The regression as plain data (in `schemas/checkpoint.schema.json`)."""
        return {name: getattr(self, name).tolist() for name in ("mean", "scale", "weight")}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> PeakRegression:
        """Rebuild a regression from `document`."""
        return cls(*(np.asarray(document[name], float) for name in ("mean", "scale", "weight")))


@torch.inference_mode()
def fit_peaks(
    network: Network, frames: Frames, episodes: tuple[int, ...], parent: PeakRegression | None = None
) -> PeakRegression | None:
    """Fit the correction to labelled presses; the ``parent``'s if fewer than `FEWEST` of them touch.

    Args:
        network: The network, on the CPU or a GPU; a correction that it has is left out.
        frames: The dataset.
        episodes: Numbers of the presses.
        parent: Correction of the network that was fitted to these presses; it is the prior's mean.
    """
    place = network.get_buffer("mean").device
    windows, top = Windows(frames, network.offsets, place), frames.sensor.map.depth_max
    features, targets, weights = [], [], []
    for number in episodes:
        span = frames.spans((number,))[0]
        rows = np.flatnonzero(frames.valid[span.start : span.stop]) + span.start
        peak = np.clip(frames.depth[rows].max(axis=(1, 2)), 0.0, top)
        rows, peak = rows[peak > LEAST], peak[peak > LEAST]
        step = -(-len(rows) // FRAMES) or 1
        rows, peak = rows[::step], peak[::step]
        if not len(rows):
            continue
        signals = network.calibrated(windows.batch(torch.as_tensor(rows, device=place)))
        depth = network.respond(signals)
        columns, largest = peak_features(depth, signals, network)
        features.append(columns.double().cpu().numpy())
        # In logarithms, as a maximum errs by a share of itself.
        targets.append(np.log(peak / (largest.double().cpu().numpy() * top)))
        # Each press counts the same, and deep frames by their depth: an error there is larger in millimetres.
        weights.append(peak / np.sqrt(len(peak)))
    if len(features) < FEWEST:
        return parent
    columns, target, weight = (np.concatenate(part) for part in (features, targets, weights))
    mean, scale = (parent.mean, parent.scale) if parent else (columns.mean(axis=0), columns.std(axis=0))
    scale = np.where(scale > 1e-6, scale, 1.0)
    expected = parent.weight if parent else np.zeros(columns.shape[1] + 1)
    design = weight[:, None] * np.column_stack([np.ones(len(columns)), (columns - mean) / scale])
    # The constant is known better than a slope beforehand, as all frames of a unit share it.
    prior = RIDGE * np.r_[0.1, np.ones(columns.shape[1])]
    remainder = weight * target - design @ expected
    change = np.linalg.solve(design.T @ design + np.diag(prior), design.T @ remainder)
    return PeakRegression(mean, scale, expected + change)
