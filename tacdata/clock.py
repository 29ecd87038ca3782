"""The host's only clock: monotonic, tied to Unix time once; a virtual rig may run it faster."""

from __future__ import annotations

from dataclasses import dataclass, field

from tacdata.host import COMPUTER, Host


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
    host: Host = field(default=COMPUTER, compare=False, repr=False)
    """Whose time it is; whoever has the clock takes threads and waiting from it too."""

    @classmethod
    def start(cls, rate: float = 1.0, host: Host = COMPUTER) -> Clock:
        """Return a clock that starts at the present time, at ``rate``."""
        return cls(host.time_ns(), host.monotonic_ns(), rate, host)

    @property
    def document(self) -> dict[str, float]:
        """The three numbers, as a rig file holds them."""
        return {"epoch_ns": self.epoch_ns, "origin_ns": self.origin_ns, "rate": self.rate}

    def now_ns(self) -> int:
        """Return the time shown [ns since 1970]."""
        return self.epoch_ns + int(self.rate * (self.host.monotonic_ns() - self.origin_ns))

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of this clock's time [s]."""
        self.host.sleep(max(seconds, 0.0) / self.rate)
