"""A camera in a simulated world: it gives an image ten times a second, hangs, or is pulled out."""

import numpy as np
from schedule import SECOND

from tacdata.devices.device import Camera, ImageFrame, StreamCounts
from tacdata.errors import DeviceError

PERIOD_NS, LATENCY_NS = SECOND // 10, 40_000_000


class SimulatedCamera(Camera):
    """A driver whose images are numbered by the world's time; it hands on what has come when it is asked."""

    def __init__(self, clock, device):
        """Be driven on the ``clock`` of a computer; ``device`` is what happens to the camera itself."""
        super().__init__(clock)
        self.device, self._next, self._first = device, 0, 0

    def describe(self):
        return {"kind": "camera", "driver": "simulated", "shape": [2, 2], "rate": {"nominal": 10.0, "unit": "Hz"}}

    @property
    def counts(self):
        return StreamCounts(received=self._next - self._first)

    def open(self):
        self._look()
        self._first = self._next = self.clock.now_ns() // PERIOD_NS + 1

    def close(self):
        pass

    def read(self, timeout):
        self._look()
        due = max(self._next * PERIOD_NS + LATENCY_NS, self.device.hangs_until_ns)
        self.clock.host.sleep(min(max((due - self.clock.now_ns()) / SECOND, 0.0), timeout))
        now, frames = self.clock.now_ns(), []
        self._look()
        while self._next * PERIOD_NS + LATENCY_NS <= now and now >= self.device.hangs_until_ns:
            number = self._next - self._first
            shown = number if self.device.frozen_at is None else self.device.frozen_at
            frames.append(ImageFrame(now, number, np.zeros((2, 2), np.uint8), b"image %d" % shown))
            self._next += 1
        return frames

    def _look(self):
        if self.device.unplugged:
            raise DeviceError("camera: it is gone", "a camera that stays connected", "plug it in")


class CameraDevice:
    """What becomes of the camera."""

    def __init__(self):
        """Be plugged in."""
        self.repair()

    def repair(self):
        """Be well again."""
        self.unplugged, self.hangs_until_ns, self.frozen_at = False, 0, None
