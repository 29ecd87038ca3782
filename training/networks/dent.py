"""One round dent at the load's place, for flat pads and few presses.

A flat pad has no load model, so nothing can be pretrained for it. But the centre of its readings lies near the contact.
So the dent's place is an affine map of that centre. Its depth and width follow from the readings' size and spread. Few
weights are left to learn. A dent is round: a shape's outline needs more presses and another network.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import torch
from torch import nn

from tacdata.sensor import Sensor
from tacdata.training.loss import WeightedLoss
from tacdata.training.networks.history import OFFSETS
from tacdata.training.networks.network import Network

WIDTHS = 8
"""Gaussians that a dent is a sum of [count]."""
_LEAST = 0.1
"""Size below which readings count as noise, over the training frames' own [1]."""


class Dent(Network):
    """Centre, size and spread of the readings to a sum of concentric Gaussians."""

    offsets = OFFSETS
    recipe: ClassVar[dict[str, Any]] = {
        "schedule": "cosine",
        "learning_rate": 5e-3,
        "loss": WeightedLoss(mixture=0.9, threshold=1 / 30, foreground=3.0),
    }

    def __init__(
        self,
        taxels: int,
        map_shape: tuple[int, int],
        places: Sequence[Sequence[float]],
        hidden: int = 32,
        offsets: Sequence[int] = OFFSETS,
    ) -> None:
        """Build the layers.

        Args:
            taxels: Number of input channels.
            map_shape: Pixels along x and y.
            places: Pixel of each taxel's centre [px], shape (taxels, 2).
            hidden: Width of the layer.
            offsets: Frames of the window relative to the target.
        """
        arguments = {"places": [list(place) for place in places], "hidden": hidden, "offsets": list(offsets)}
        super().__init__(taxels, map_shape, arguments)
        self.offsets = tuple(offsets)
        self.register_buffer("places", torch.tensor(places, dtype=torch.float32), persistent=False)
        self.register_buffer("widths", torch.logspace(0.0, 1.0, WIDTHS) * max(map_shape) / 40, persistent=False)
        self.shift = nn.Linear(2, 2)
        nn.init.eye_(self.shift.weight)
        nn.init.zeros_(self.shift.bias)
        self.layers = nn.Sequential(
            nn.Linear(len(self.offsets) + 3, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU()
        )
        self.depths = nn.Linear(hidden, WIDTHS)

    @classmethod
    def geometry(cls, sensor: Sensor) -> dict[str, Any]:
        """Return the pixels of the taxels' centres."""
        middle = [(pixels - 1) / 2 for pixels in sensor.map.shape]
        return {"places": (sensor.taxels.centers / sensor.map.pixel_pitch + middle).tolist()}

    def respond(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max; (b, T, taxels) -> (b, pixels_x, pixels_y).

        All channels are divided by one number, which keeps zeros and the centre.
        """
        return self.estimate(signals / self.get_buffer("sd").square().mean().sqrt())

    def estimate(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from scaled windows; (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        size, places, widths = signals.abs(), self.get_buffer("places"), self.get_buffer("widths")
        total, newest = size.sum(dim=2) + _LEAST, size[:, self.offsets.index(0)]
        share = newest / (newest.sum(dim=1, keepdim=True) + _LEAST)
        centre, largest = share @ places, share.topk(3, dim=1).values
        half = places.abs().max() / 2
        place = half * (1.0 + self.shift(centre / half - 1.0))
        depths = self.depths(self.layers(torch.cat([total.log(), largest], dim=1)))
        # No readings, no dent.
        depths = depths * share.sum(dim=1, keepdim=True)
        square = [
            (torch.arange(count, device=signals.device) - place[:, i : i + 1]).square()
            for i, count in enumerate(self.map_shape)
        ]
        bells = [torch.exp(part[:, None] / (-2.0 * widths[:, None].square())) for part in square]
        return torch.einsum("bk,bkx,bky->bxy", depths, *bells)
