"""The training loss (paper, eq. weighted_loss)."""

from __future__ import annotations

from dataclasses import dataclass

import torch


@dataclass(frozen=True)
class WeightedLoss:
    """Foreground-weighted mixture of squared and absolute error on maps over D_max."""

    mixture: float = 0.5
    """lambda: share of the squared error [1]."""
    threshold: float = 0.3
    """delta: a pixel is foreground if its label over D_max exceeds this [1]: 0.9 mm at D_max = 3 mm."""
    foreground: float = 2.0
    """gamma: weight of foreground pixels [1]; the others weigh 1."""

    def __call__(self, prediction: torch.Tensor, label: torch.Tensor) -> torch.Tensor:
        """Return the mean over pixels and frames, a scalar; both arguments (b, h, w) over D_max.

        Labels are normalized by `normalized`, so that depths beyond D_max count as D_max.
        """
        error = prediction - label
        weight = 1.0 + (self.foreground - 1.0) * (label > self.threshold)
        return (weight * (self.mixture * error.square() + (1.0 - self.mixture) * error.abs())).mean()


def normalized(depth: torch.Tensor, depth_max: float) -> torch.Tensor:
    """Return clip(depth, 0, D_max) / D_max of depth maps [mm] (paper, section on labels)."""
    return depth.clamp(0.0, depth_max) / depth_max
