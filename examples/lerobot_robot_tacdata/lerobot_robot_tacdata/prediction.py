"""Depth maps predicted while a board is read."""

from __future__ import annotations

import numpy as np

from tacdata.devices.device import TaxelBoard, TaxelFrame
from tacdata.errors import UsageError
from tacdata.live.depth_stream import DepthStream
from tacdata.recording.live.device_streams import stream_clock
from tacdata.sensor import Sensor
from tacdata.training.inference.sequence import identity, window_map
from tacdata.training.pretraining.shipped import pretrained

ENLARGED = 4
"""Pixels of the picture along a pixel of the map [1]: video codecs need 64 pixels and even numbers."""


class Prediction:
    """A network over the newest window of a board's samples."""

    def __init__(self, network: str, tare: float, board: TaxelBoard, sensor: Sensor) -> None:
        """Load the network.

        Args:
            network: Run, checkpoint or "shipped".
            tare: Time at rest over which readings are tared [s].
            board: The board.
            sensor: Its sensor.

        Raises:
            UsageError: If the board's rate is no multiple of the rate of which the network's window is.
            FormatError: If the network is of another sensor.
        """
        trained = pretrained(network)
        trained.check_sensor(sensor, network)
        rate = board.describe()["rate"]["nominal"] or sensor.taxels.rate
        self._step = round(rate / sensor.taxels.rate)
        if not self._step or abs(rate / (self._step * sensor.taxels.rate) - 1) > 0.05:
            raise UsageError(
                f"a board at {rate:g} Hz for a network at {sensor.taxels.rate:g} Hz",
                f"a multiple of {sensor.taxels.rate:g} Hz",
                "leave network out, or train one at the board's rate",
            )
        frames = max(1, round(tare * sensor.taxels.rate))
        clock = stream_clock(board)
        self._stream = DepthStream(window_map(trained), trained.network.offsets, sensor.map, clock, frames, True)
        self._top, self._count = sensor.map.depth_max, 0
        self.identity = identity(trained)
        """Hash, name and sensor of the network."""
        self.depth = np.zeros(sensor.map.shape, np.float32)
        """The newest map [mm], shape (pixels_x, pixels_y); zeros until the readings are tared."""

    def push(self, frame: TaxelFrame) -> None:
        """Take a sample."""
        self._count += 1
        if self._count % self._step == 0 and (found := self._stream.push(frame)):
            self.depth = found.depth

    @property
    def picture(self) -> np.ndarray:
        """The newest map as a grey image, 255 at the largest depth, shape (height, width, 3), uint8."""
        grey = np.round(255 * np.clip(self.depth / self._top, 0.0, 1.0)).astype(np.uint8)
        return np.repeat(grey.repeat(ENLARGED, 0).repeat(ENLARGED, 1)[:, :, None], 3, axis=2)
