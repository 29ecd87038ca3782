"""The host's only clock: monotonic, tied to Unix time once; a virtual rig may run it faster."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tacdata.host import COMPUTER, Host
from tacdata.paced_host import PacedHost


@dataclass(frozen=True)
class Clock:
    """Nanoseconds since the Unix epoch, without steps: ``epoch + rate * (monotonic - origin)``.

    Two processes with the same document read the same time, since `CLOCK_MONOTONIC` belongs to the machine.
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

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Clock:
        """Return the clock of a virtual rig, from ``clock`` in its rig file."""
        numbers = {name: value for name, value in document.items() if name != "pace"}
        return cls(**numbers, host=PacedHost(Path(document["pace"])) if "pace" in document else COMPUTER)

    @property
    def document(self) -> dict[str, Any]:
        """Its numbers, as a rig file holds them."""
        pace = {"pace": str(self.host.path.absolute())} if isinstance(self.host, PacedHost) else {}
        return {"epoch_ns": self.epoch_ns, "origin_ns": self.origin_ns, "rate": self.rate, **pace}

    def now_ns(self) -> int:
        """Return the time shown [ns since 1970]."""
        return self.epoch_ns + int(self.rate * (self.host.monotonic_ns() - self.origin_ns))

    def serve(self, device: str, due_ns: int | None) -> None:
        """Take that an emulated device has nothing to do before ``due_ns`` [ns since 1970]; None once it has ended.

        The time of a virtual rig goes no further until the device calls again (`tacdata.paced_host.PacedHost`).
        """
        if due_ns is not None:
            due_ns = self.origin_ns + int((due_ns - self.epoch_ns) / self.rate)
        self.host.serve(device, due_ns)

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of this clock's time [s]."""
        self.host.sleep(max(seconds, 0.0) / self.rate)
