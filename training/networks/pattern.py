"""No look-ahead: the pattern of a window apart from its scale, through a residual perceptron to all pixels at once.

The pattern of readings determines the place of contact, their size its depth. A unit's gain is uncertain, its
pattern is not. So the window over its own root mean square and the logarithms of that scale are separate inputs.
Frames as in `history`. It is meant to be trained on forces (`training.frames.channel_calibration`), so that its
learned from simulated presses holds for any unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any, ClassVar

import torch
from torch import nn

from tacdata.training.loss import WeightedLoss
from tacdata.training.networks.history import OFFSETS
from tacdata.training.networks.network import Network, ResidualLayers

_LEAST = 0.01
"""Scale below which a window counts as noise, over the training frames' own [1]."""


class Pattern(Network):
    """Pattern and scale of the past to pixels."""

    offsets = OFFSETS
    recipe: ClassVar[dict[str, Any]] = {
        "calibrate": True,
        "mirror": True,
        "schedule": "cosine",
        "batch_size": 128,
        "gain_jitter": 0.05,
        "scale_jitter": 0.05,
        "exponent_jitter": 0.03,
        "loss": WeightedLoss(mixture=0.9, threshold=1 / 30, foreground=3.0),
    }

    def __init__(
        self,
        taxels: int,
        map_shape: tuple[int, int],
        hidden: int = 384,
        layers: int = 2,
        offsets: Sequence[int] = OFFSETS,
    ) -> None:
        """Build the layers.

        Args:
            taxels: Number of input channels.
            map_shape: Pixels along x and y.
            hidden: Width of the layers.
            layers: Residual layers.
            offsets: Frames of the window relative to the target.
        """
        super().__init__(taxels, map_shape, {"hidden": hidden, "layers": layers, "offsets": list(offsets)})
        self.offsets = tuple(offsets)
        self.encoder = nn.Linear(taxels * len(self.offsets) + 2, hidden)
        self.layers = ResidualLayers(hidden, layers)
        self.decoder = nn.Sequential(nn.LayerNorm(hidden), nn.Linear(hidden, prod(map_shape)))

    def respond(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max; (b, T, taxels) -> (b, pixels_x, pixels_y).

        All channels are divided by one number, which keeps zeros and the pattern.
        """
        return self.estimate(signals / self.get_buffer("sd").square().mean().sqrt())

    def estimate(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from scaled windows; (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        window = (signals.square().mean(dim=(1, 2)) + _LEAST**2).sqrt()
        newest = (signals[:, -1].square().mean(dim=1) + _LEAST**2).sqrt()
        pattern = (signals / window[:, None, None]).flatten(1)
        features = self.encoder(torch.cat([pattern, window.log()[:, None], newest.log()[:, None]], dim=1))
        return self.decoder(self.layers(features)).reshape(-1, *self.map_shape)
