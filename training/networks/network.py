"""The content of a network's file.

A file ``training/networks/my_network.py`` defines one class derived from `Network`. It sets ``offsets``,
takes the sensor's sizes and its own arguments (plain JSON values) in ``__init__``, hands both to the base,
and implements `estimate`. Every size must follow from the sensor's, so that another skin needs no code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import numpy as np
import torch
from torch import nn

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.sensor import Sensor

ROOM, BASE = "tacdata.training.networks", "network"
CALIBRATION_UNIT = 1000.0
"""Reading at which a calibrated channel's force is its gain [counts]."""


class Correction(Protocol):
    """Change of a network's maps by what presses of the unit show."""

    def corrected(self, depth: torch.Tensor, signals: torch.Tensor, network: Network) -> torch.Tensor:
        """Return maps over D_max from maps and the output of `Network.calibrated`."""
        ...

    def moved(self, change: Callable[[torch.Tensor], torch.Tensor]) -> Correction:
        """Return the correction with each tensor changed: another device or precision."""
        ...


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
        self.peak: Correction | None = None
        """Correction of each map's maximum (`training.frames.peak_process`); None without."""

    @classmethod
    def geometry(cls, sensor: Sensor) -> dict[str, Any]:
        """Return the arguments that follow from the sensor's geometry; none by default."""
        return {}

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

    def _apply(self, fn: Callable[[torch.Tensor], torch.Tensor], recurse: bool = True) -> Network:
        # The correction is no module, as its values are not trained: it moves with the weights here.
        if self.peak is not None:
            self.peak = self.peak.moved(fn)
        return super()._apply(fn, recurse)

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Return depth maps over D_max, not clipped; (b, T, taxels) [counts] -> (b, pixels_x, pixels_y)."""
        signals = self.calibrated(windows)
        depth = self.respond(signals)
        return depth if self.peak is None else self.peak.corrected(depth, signals, self)

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
        return kind(
            taxels=sensor.taxels.count, map_shape=sensor.map.shape, **{**kind.geometry(sensor), **(arguments or {})}
        )
    except TypeError as error:
        raise FormatError(
            f"network {name} with arguments {arguments}: {error}",
            f"the arguments in training/networks/{name}.py",
            "correct the arguments",
        ) from None
