"""The content of a network's file.

A file ``training/networks/my_network.py`` defines one class derived from `Network`. It sets ``offsets``,
takes the sensor's sizes and its own arguments (plain JSON values) in ``__init__``, hands both to the base,
and implements `estimate`. Every size must follow from the sensor's, so that another skin needs no code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
import torch
from torch import nn

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.sensor import Sensor

ROOM, BASE = "tacdata.training.networks", "network"
CALIBRATION_UNIT = 1000.0
"""Reading at which a calibrated channel's force is its gain [counts]."""
SHALLOW = 0.01
"""Maximum of a map over D_max below which it is not corrected [1]: 0.03 mm at D_max = 3 mm."""
EDGE = 1 / 30
"""Depth over D_max from which a pixel counts as in contact [1]: 0.1 mm at D_max = 3 mm."""
FARTHEST = 0.4
"""Largest correction of a maximum, in its logarithm [1]."""
_BEYOND = 3.0
"""Standard deviations beyond which a feature is not extrapolated [1]."""


class Network(nn.Module, ABC):
    """A map from a window of taxel signals to the depth map of its target frame."""

    offsets: tuple[int, ...]
    """Frames of the window relative to the target frame, ascending; the largest is the look-ahead."""
    recipe: ClassVar[dict[str, Any]] = {}
    """Training settings that suit it and differ from the paper's; a person's options come before them."""

    def __init__(self, taxels: int, map_shape: tuple[int, int], arguments: dict[str, Any]) -> None:
        """Keep the sizes and the arguments, from which `create` can build the same network again."""
        super().__init__()
        self.taxels, self.map_shape, self.arguments = taxels, map_shape, arguments
        # The checkpoint's document holds these two; a second copy among the weights could contradict it.
        self.register_buffer("mean", torch.zeros(taxels), persistent=False)
        self.register_buffer("sd", torch.ones(taxels), persistent=False)
        self.register_buffer("gain", torch.ones(taxels), persistent=False)
        self.register_buffer("exponent", torch.ones(()), persistent=False)
        self.register_buffer("mixing", torch.eye(taxels), persistent=False)
        self.is_calibrated = False
        """Whether readings are turned into forces before anything else."""
        self.peak: tuple[torch.Tensor, torch.Tensor, torch.Tensor] | None = None
        """Mean and deviation of `peak_features` and the coefficients of the maximum's correction; None without."""

    @property
    def name(self) -> str:
        """The network's name: its file's name."""
        return type(self).__module__.rsplit(".", 1)[-1]

    def set_normalization(self, mean: np.ndarray, sd: np.ndarray) -> None:
        """Set the mean and standard deviation of each channel [counts], shape (taxels,)."""
        self.get_buffer("mean").copy_(torch.as_tensor(mean, dtype=torch.float32))
        self.get_buffer("sd").copy_(torch.as_tensor(sd, dtype=torch.float32))

    def set_calibration(self, gain: np.ndarray, exponent: float, mixing: np.ndarray | None = None) -> None:
        """Turn readings into forces from now on: force = mixing gain sign(c) (|c| / 1000 counts)^exponent.

        Args:
            gain: Force at 1000 counts [N], shape (taxels,).
            exponent: Exponent of the reading [1].
            mixing: Weights that spread forces over neighbours [1], shape (taxels, taxels); none if left out.
        """
        mixing = np.eye(self.taxels) if mixing is None else mixing
        self.get_buffer("mixing").copy_(torch.as_tensor(mixing, dtype=torch.float32))
        self.get_buffer("gain").copy_(torch.as_tensor(gain, dtype=torch.float32))
        self.get_buffer("exponent").fill_(exponent)
        self.is_calibrated = True

    def set_peak(self, mean: np.ndarray, scale: np.ndarray, weight: np.ndarray) -> None:
        """Correct the maximum of each map from now on (`training.frames.peak_regression`)."""
        place = self.get_buffer("mean").device
        mean_, scale_, weight_ = (torch.as_tensor(v, dtype=torch.float32, device=place) for v in (mean, scale, weight))
        self.peak = mean_, scale_, weight_

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Return depth maps over D_max, not clipped; (b, T, taxels) [counts] -> (b, pixels_x, pixels_y)."""
        signals = self.calibrated(windows)
        depth = self.respond(signals)
        if self.peak is None:
            return depth
        mean, scale, weight = (values.to(depth.device) for values in self.peak)
        features, largest = peak_features(depth, signals, self)
        # Beyond the presses of the fit a straight line is no guide; it is held at its end.
        standard = ((features - mean) / scale).clamp(-_BEYOND, _BEYOND)
        ratio = (weight[0] + standard @ weight[1:]).clamp(-FARTHEST, FARTHEST).exp()
        ratio = torch.where(largest > SHALLOW, ratio, torch.ones_like(ratio))
        # In proportion to the depth: the maximum takes all of the correction, the region's edge nearly none.
        share = depth.clamp(min=0.0) / largest[:, None, None]
        return depth * (1.0 + (ratio[:, None, None] - 1.0) * share)

    def calibrated(self, windows: torch.Tensor) -> torch.Tensor:
        """Return forces [N] for readings [counts], (b, T, taxels); the readings where there is no calibration."""
        if not self.is_calibrated:
            return windows
        size = (windows.abs() / CALIBRATION_UNIT).clamp(min=1e-9)
        force = self.get_buffer("gain") * torch.sign(windows) * size.pow(self.get_buffer("exponent"))
        return force @ self.get_buffer("mixing").T

    def respond(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from the output of `calibrated`; (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        return self.estimate((signals - self.get_buffer("mean")) / self.get_buffer("sd"))

    @abstractmethod
    def estimate(self, signals: torch.Tensor) -> torch.Tensor:
        """Return maps over D_max from standardized windows; (b, T, taxels) -> (b, pixels_x, pixels_y)."""


def peak_features(depth: torch.Tensor, signals: torch.Tensor, network: Network) -> tuple[torch.Tensor, torch.Tensor]:
    """Return quantities of map and loads on which a maximum's error depends (b, features), and the maxima (b,).

    Depth, region and load of a contact, how the load is shared between taxels, and how it changes with time.

    Args:
        depth: Maps over D_max, shape (b, pixels_x, pixels_y).
        signals: Output of `Network.calibrated`, shape (b, T, taxels).
        network: The network, for the scale of its signals and its window.
    """
    largest = depth.amax(dim=(1, 2)).clamp(min=SHALLOW)
    size = signals.abs() / network.get_buffer("sd").square().mean().sqrt()
    newest, oldest = size[:, network.offsets.index(0)], size[:, 0].sum(dim=1).clamp(min=1e-3)
    total = newest.sum(dim=1).clamp(min=1e-3)
    area = (depth > EDGE).float().sum(dim=(1, 2)) + 1.0
    half = (depth > 0.5 * largest[:, None, None]).float().sum(dim=(1, 2)) + 1.0
    deep, load = largest.log(), total.log()
    concentration = (newest.topk(4, dim=1).values.sum(dim=1) / total).clamp(min=1e-3).log()
    # Loading or unloading: a relaxing skin has two depths for one reading.
    change = (total / oldest).log().clamp(-2.0, 2.0)
    products = [deep**2, load**2, deep * load, concentration * deep, concentration * load]
    return torch.stack([deep, load, area.log(), half.log(), change, concentration, *products], dim=1), largest


class ResidualLayers(nn.ModuleList):
    """Perceptrons one after the other, each added to its input."""

    def __init__(self, width: int, count: int) -> None:
        """Build ``count`` layers of a width."""
        super().__init__(
            nn.Sequential(nn.LayerNorm(width), nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
            for _ in range(count)
        )

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return features of the same shape (b, width)."""
        for layer in self:
            features = features + layer(features)
        return features


def create(name: str, sensor: Sensor, arguments: dict[str, Any] | None = None) -> Network:
    """Build a network for a sensor.

    Raises:
        UsageError: If no such network exists.
        FormatError: If it does not know one of the arguments.

    Example:
        >>> import torch
        >>> from tacdata.sensor import default_sensor
        >>> from tacdata.training.networks.network import create
        >>> network = create("paper", default_sensor())
        >>> network(torch.zeros(2, 9, 24)).shape  # a batch of two windows gives two maps
        torch.Size([2, 35, 26])
    """
    kind = registry.load(ROOM, BASE, name, Network)
    try:
        return kind(taxels=sensor.taxels.count, map_shape=sensor.map.shape, **(arguments or {}))
    except TypeError as error:
        raise FormatError(
            f"network {name} with arguments {arguments}: {error}",
            f"the arguments in training/networks/{name}.py",
            "correct the arguments",
        ) from None
