"""Rehearsal: simulated frames mixed into training on recorded ones, to prevent forgetting.

A few recorded presses show a small part of the skin. Trained on them alone, a network forgets the rest (R. French,
Trends in Cognitive Sciences 3 (1999) 128). Each step therefore takes as many simulated frames as recorded ones.
"""

from __future__ import annotations

import numpy as np
import torch

from tacdata.errors import UsageError
from tacdata.training.frames.channel_calibration import calibrate
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.label_tensor import label_tensor
from tacdata.training.frames.variation import Variation
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.loss import normalized
from tacdata.training.networks.network import Network, create
from tacdata.training.settings import TrainingSettings


class Rehearsal:
    """Simulated frames, drawn at random; varied as when the pretrained network saw them."""

    def __init__(
        self, frames: Frames, pretrained: Checkpoint | None, network: Network, place: torch.device | str
    ) -> None:
        """Prepare the windows.

        Args:
            frames: A simulated dataset of the same sensor.
            pretrained: Whose calibration and variation the simulated frames get; calibrated here, not varied if None.
            network: The network in training.
            place: Where batches are gathered.

        Raises:
            UsageError: If the frames were recorded.
            FormatError: If they are of another sensor.
        """
        if not frames.simulated:
            raise UsageError(
                f"{frames.origin} as simulated frames: it holds recorded ones",
                "a dataset that `tacdata simulate` made",
                "give the recorded dataset as the first argument, and the simulated one as --simulated",
            )
        self._windows = Windows(frames, network.offsets, place)
        self._depth = label_tensor(frames.depth, torch.device(place))
        self._usable = torch.as_tensor(np.flatnonzero(frames.valid))
        self._depth_max, self._place = frames.sensor.map.depth_max, place
        source = create(network.name, frames.sensor, network.arguments).to(place)
        source.set_normalization(network.get_buffer("mean").cpu().numpy(), network.get_buffer("sd").cpu().numpy())
        # The unit's own calibration would be wrong for simulated frames: they have the gains that the pretrained
        # network saw.
        if network.is_calibrated:
            calibration = pretrained.calibration if pretrained else None
            calibration = calibration or calibrate(frames, tuple(span.number for span in frames.episodes))
            source.set_calibration(calibration.gain, calibration.exponent, calibration.mixing)
        settings = pretrained.settings if pretrained else TrainingSettings()
        self._source, self._varied = source, Variation(source, frames.sensor, settings)

    def batch(self, size: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Return signals [counts or N], (size, T, taxels), and labels over D_max, (size, pixels_x, pixels_y)."""
        indices = self._usable[torch.randint(len(self._usable), (size,))]
        label = normalized(self._depth[indices.to(self._depth.device)].to(self._place).float(), self._depth_max)
        return self._varied(self._source.calibrated(self._windows.batch(indices.to(self._place))), label)
