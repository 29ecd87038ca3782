"""The paper's network: a single-layer LSTM over nine centred frames and a transposed-convolution decoder.

Printed in the paper: T = 9 (K = 4), a single-layer unidirectional LSTM of 256 units whose last hidden state
is decoded by a linear projection, a reshape to 32 x 9 x 7, two transposed convolutions and convolutional
refinement to 35 x 26 (eqs. temporal_window, lstm_encoding, depth_decoder).

Assumed here, because the paper does not print it: both transposed convolutions double the size (kernel 4,
stride 2, padding 1; 9 x 7 -> 18 x 14 -> 36 x 28) with 32 and 16 channels; the result is cropped about its
centre to 35 x 26; refinement is two 3 x 3 convolutions, 16 -> 16 -> 1; ReLU between layers and none at the
output. The signals are standardized per channel over the training split.
"""

from __future__ import annotations

import torch
from torch import nn

from tacdata.training.networks.network import Network


class Paper(Network):
    """The network of the paper; any map starts from a quarter of its size, rounded up (35 x 26 -> 9 x 7)."""

    offsets = (-4, -3, -2, -1, 0, 1, 2, 3, 4)

    def __init__(self, taxels: int, map_shape: tuple[int, int], hidden: int = 256, channels: int = 32) -> None:
        """Build the layers.

        Args:
            taxels: Number of input channels.
            map_shape: Pixels along x and y.
            hidden: Units of the LSTM.
            channels: Channels of the coarse feature map.
        """
        super().__init__(taxels, map_shape, {"hidden": hidden, "channels": channels})
        # Both transposed convolutions double the size. Rounded up, as `_crop` can only cut.
        self.coarse = (channels, -(-map_shape[0] // 4), -(-map_shape[1] // 4))
        self.encoder = nn.LSTM(taxels, hidden, batch_first=True)
        self.projection = nn.Linear(hidden, channels * self.coarse[1] * self.coarse[2])
        self.decoder = nn.Sequential(
            nn.ReLU(),
            nn.ConvTranspose2d(channels, channels, kernel_size=4, stride=2, padding=1),
            nn.ReLU(),
            nn.ConvTranspose2d(channels, channels // 2, kernel_size=4, stride=2, padding=1),
            nn.ReLU(),
        )
        self.refinement = nn.Sequential(
            nn.Conv2d(channels // 2, channels // 2, kernel_size=3, padding=1),
            nn.ReLU(),
            nn.Conv2d(channels // 2, 1, kernel_size=3, padding=1),
        )

    def encode(self, signals: torch.Tensor) -> torch.Tensor:
        """Return features of standardized windows; (b, T, taxels) -> (b, hidden)."""
        _, (hidden, _) = self.encoder(signals)
        return hidden[-1]

    def estimate(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from standardized windows; (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        features = self.decoder(self.projection(self.encode(signals)).reshape(-1, *self.coarse))
        return self.refinement(_crop(features, self.map_shape))[:, 0]


def _crop(maps: torch.Tensor, shape: tuple[int, int]) -> torch.Tensor:
    """Cut maps (b, c, h, w) about their centre to ``shape``; an odd surplus goes off the far end."""
    top, start = (maps.shape[2] - shape[0]) // 2, (maps.shape[3] - shape[1]) // 2
    return maps[:, :, top : top + shape[0], start : start + shape[1]]
