"""The host's only clock: monotonic, tied to Unix time once; a virtual rig may run it faster."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True)
class Clock:
    """Nanoseconds since the Unix epoch, without steps: ``epoch + rate * (monotonic - origin)``.

    Two processes with the same three numbers read the same time, since `CLOCK_MONOTONIC` belongs to the machine.
    """

    epoch_ns: int
    """Time shown at the origin [ns since 1970]."""
    origin_ns: int
    """`time.monotonic_ns()` at the origin [ns]."""
    rate: float = 1.0
    """Seconds shown per real second; 1 with real devices."""

    @classmethod
    def start(cls, rate: float = 1.0) -> Clock:
        """Return a clock that shows the present time now and runs at ``rate``."""
        return cls(time.time_ns(), time.monotonic_ns(), rate)

    def now_ns(self) -> int:
        """Return the time shown [ns since 1970]."""
        return self.epoch_ns + int(self.rate * (time.monotonic_ns() - self.origin_ns))

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of this clock's time [s]."""
        time.sleep(max(seconds, 0.0) / self.rate)
