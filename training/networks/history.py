"""No look-ahead: the newest frames and some of the past, ever further apart, through a residual perceptron.

The window reaches 2 s back at 30 Hz, so the network can distinguish loading, holding and unloading, which are equal
in the newest frames of a skin that relaxes; it costs nine frames like the paper's. The encoder has no recurrence: one
frame is a few matrix products. Decoder as in `paper`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import nn

from tacdata.training.networks.network import ResidualLayers
from tacdata.training.networks.paper import Paper

OFFSETS = (-64, -32, -16, -8, -4, -3, -2, -1, 0)


class History(Paper):
    """Frames of the past at growing distances; the newest is the target."""

    def __init__(
        self,
        taxels: int,
        map_shape: tuple[int, int],
        hidden: int = 256,
        channels: int = 32,
        layers: int = 2,
        offsets: Sequence[int] = OFFSETS,
    ) -> None:
        """Build the layers.

        Args:
            taxels: Number of input channels.
            map_shape: Pixels along x and y.
            hidden: Width of the encoder.
            channels: Channels of the coarse feature map.
            layers: Residual layers of the encoder.
            offsets: Frames of the window relative to the target.
        """
        super().__init__(taxels, map_shape, hidden, channels)
        self.offsets = tuple(offsets)
        self.arguments = {"hidden": hidden, "channels": channels, "layers": layers, "offsets": list(offsets)}
        self.encoder = nn.Linear(taxels * len(self.offsets), hidden)
        self.layers = ResidualLayers(hidden, layers)

    def encode(self, signals: torch.Tensor) -> torch.Tensor:
        """Return features of standardized windows; (b, T, taxels) -> (b, hidden)."""
        return self.layers(self.encoder(signals.flatten(1)))
