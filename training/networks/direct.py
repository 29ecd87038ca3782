"""The smallest and fastest: a perceptron over the windows of `history` that answers with all pixels at once.

No convolutions: each pixel is a mixture of features, as a depth map is smooth and its place is bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import torch
from torch import nn

from tacdata.training.networks.history import OFFSETS
from tacdata.training.networks.network import Network


class Direct(Network):
    """Frames of the past to pixels by three layers."""

    offsets = OFFSETS

    def __init__(
        self, taxels: int, map_shape: tuple[int, int], hidden: int = 256, offsets: Sequence[int] = OFFSETS
    ) -> None:
        """Build the layers.

        Args:
            taxels: Number of input channels.
            map_shape: Pixels along x and y.
            hidden: Width of the layers.
            offsets: Frames of the window relative to the target.
        """
        super().__init__(taxels, map_shape, {"hidden": hidden, "offsets": list(offsets)})
        self.offsets = tuple(offsets)
        self.layers = nn.Sequential(
            nn.Linear(taxels * len(self.offsets), hidden),
            nn.SiLU(),
            nn.Linear(hidden, hidden),
            nn.SiLU(),
            nn.Linear(hidden, prod(map_shape)),
        )

    def estimate(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from standardized windows; (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        return self.layers(signals.flatten(1)).reshape(-1, *self.map_shape)
