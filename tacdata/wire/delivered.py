"""Data of the serial lines: readings, status reports, and their counts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.errors import DeviceError


@dataclass(frozen=True)
class TaxelFrame:
    """One reading of all channels, not tared."""

    arrival_ns: int
    """Host time of the frame's last byte [ns]."""
    counter: int
    """The device's frame counter, unwrapped from the wire's width [frames]; -1 if the format has none."""
    counts: np.ndarray
    """Raw readings [counts], shape (channels,), float64."""
    device_ns: int = -1
    """The device's own time stamp, unwrapped [ns of the device's clock]; -1 if the format has none."""


@dataclass(frozen=True)
class CncStatus:
    """One status report."""

    sent_ns: int
    """Host time at which the query went out [ns]."""
    arrival_ns: int
    """Host time at which the answer was complete [ns]."""
    state: str
    """Controller state as it names it, for example "Run", "Hold:0", "Alarm"; "Idle" only at rest."""
    position: np.ndarray
    """Machine position [mm], shape (3,)."""
    feed: float
    """Reported feed rate [mm/min]."""


@dataclass
class StreamCounts:
    """Counts of a stream's data so far."""

    received: int = 0
    """Good frames."""
    lost: int = 0
    """Frames missing by the device's counter."""
    repeated: int = 0
    """Frames with a counter already seen."""
    corrupt: int = 0
    """Frames discarded by checksum or format."""
    garbage_bytes: int = 0
    """Bytes skipped while resynchronizing."""
    notes: list[str] = field(default_factory=list)
    """Further remarks for a person, as sentences."""


class OwesAnswer(DeviceError):
    """The controller is idle and owes answers: one was lost, or the firmware stalled."""


class StandsStill(DeviceError):
    """A machine that has come to rest, and whose motion cannot be abandoned."""

    def __init__(self, given: str, allowed: str, remedy: str, at: tuple[float, float, float] | None = None) -> None:
        """Give the reason; ``at`` is its position [mm, machine], if that is known."""
        super().__init__(given, allowed, remedy)
        self.at = at
