"""Training frames varied at random: mirrored like the sensor, with gains, laws and spreading of other specimens."""

from __future__ import annotations

import numpy as np
import torch

from tacdata.sensor import Sensor
from tacdata.training.frames.spreading import laplacian
from tacdata.training.networks.network import Network
from tacdata.training.settings import TrainingSettings


class Variation:
    """Changes batches as the settings ask; without such settings it returns them as they are."""

    def __init__(self, network: Network, sensor: Sensor, settings: TrainingSettings) -> None:
        """Prepare the mirrored orders of the taxels (k = i + columns j)."""
        self.mirror, self.jitter = settings.mirror, settings.gain_jitter
        self.scale, self.exponent = settings.scale_jitter, settings.exponent_jitter
        self.mean, self.sd = network.get_buffer("mean"), network.get_buffer("sd")
        self.calibrated = network.is_calibrated
        self.spread = settings.spread_jitter
        # In these modes spreading is a factor each, so every frame can have a variance of its own.
        values, modes = np.linalg.eigh(laplacian(sensor.taxels) / 2)
        to = {"dtype": torch.float32, "device": self.mean.device}
        self.values, self.modes = torch.as_tensor(values, **to), torch.as_tensor(modes, **to)
        order = torch.arange(sensor.taxels.count, device=self.mean.device)
        grid = order.reshape(sensor.taxels.rows, sensor.taxels.columns)
        self.orders = [grid.flip(dims).reshape(-1) for dims in ([], [1], [0], [0, 1])]

    def __call__(self, signals: torch.Tensor, label: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return signals [counts or N], (b, T, taxels), and labels over D_max, (b, pixels_x, pixels_y), varied."""
        if self.mirror:
            signals, label = self._mirrored(signals, label)
        if self.spread:
            # Of either sign: a unit's skin may spread loads less than the model does.
            variance = self.spread * torch.randn(len(signals), 1, 1, device=signals.device)
            signals = ((signals @ self.modes) * (variance * self.values).exp()) @ self.modes.T
        if self.exponent:
            change = self.exponent * torch.randn(len(signals), 1, 1, device=signals.device)
            unit = self.sd.square().mean().sqrt()
            # A negative change of the exponent would make a reading of zero infinite.
            signals = signals * (signals.abs() / unit).clamp(min=1e-6).pow(change)
        if self.scale:
            # Log-normal: the gain of a unit is never negative.
            signals = signals * (self.scale * torch.randn(len(signals), 1, 1, device=signals.device)).exp()
        if self.jitter:
            factor = 1.0 + self.jitter * torch.randn(len(signals), 1, signals.shape[2], device=signals.device)
            signals = signals * factor
        return signals, label

    def _mirrored(self, signals: torch.Tensor, label: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        # Mirrored after standardizing, so that a channel's gain does not travel to the channel opposite. Forces are
        # without gains.
        standard = signals if self.calibrated else (signals - self.mean) / self.sd
        # The sensor is symmetric about both axes, so mirrored presses are presses that it could have felt.
        way = torch.randint(4, (len(signals),), device=signals.device)
        order = torch.stack(self.orders)[way]
        mirrored = standard.gather(2, order[:, None, :].expand(-1, signals.shape[1], -1))
        x, y = (way % 2 == 1)[:, None, None], (way >= 2)[:, None, None]
        label = torch.where(x, label.flip(1), label)
        mirrored = mirrored if self.calibrated else mirrored * self.sd + self.mean
        return mirrored, torch.where(y, label.flip(2), label)
