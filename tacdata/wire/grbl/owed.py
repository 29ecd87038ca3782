"""Waiting for the controller: every wait has a reason, a timeout and an error message."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tacdata.clock import Clock
from tacdata.errors import DeviceError
from tacdata.wire.delivered import CncStatus, OwesAnswer
from tacdata.wire.patience import EMULATED, REAL_FLOOR, Patience

IDLE, IDLE_FLOOR = 2.0, 1.5
"""Time after the end of its motion within which an idle controller must answer [s of the clock], and its minimum [s,
real time]. Idle means that nothing runs that could delay the answer; a pause (G4) counts as motion.
"""
FLOOR = 3.0
"""Shortest timeout for a line's answer [s, real time], so that an idle controller is recognized as idle first."""


@dataclass(frozen=True)
class Owed:
    """One thing that is waited for, with its timeout."""

    what: str
    """Description, for example "an answer to 'G4P0.01'"."""
    limit: float
    """Timeout [s of the clock]."""
    motion: float = 0.0
    """Longest duration of the motion and pauses queued before it [s of the clock]."""
    heard: Sequence[str] = ()
    """Other messages received in the meantime; read when the wait ends."""
    idle_ends_it: bool = False
    """Whether an idle controller can no longer send it."""

    def watch(self, clock: Clock) -> Watch:
        """Begin to wait."""
        return Watch(self, clock)


class Watch:
    """Watches over one wait; the caller checks several times per second, with the latest report."""

    def __init__(self, owed: Owed, clock: Clock) -> None:
        """Start now."""
        self._owed, self._clock = owed, clock
        self._due_ns = clock.now_ns() + round(min(owed.motion, owed.limit) * 1e9)
        floor = FLOOR if owed.idle_ends_it else min(max(owed.limit, REAL_FLOOR), EMULATED)
        self._late = Patience(owed.limit, clock.rate, floor, host=clock.host)
        self._idle = Patience(IDLE, clock.rate, IDLE_FLOOR, host=clock.host)

    def ending(self, last: CncStatus | None, late: float = 0.0) -> DeviceError | None:
        """Return why the wait must end, or None; ``late`` is this computer's lateness in reading [s, real time]."""
        # The clock for a lost answer runs only while the machine is idle: a long move owes its answer for as long as it
        # lasts.
        if last is None or last.state != "Idle" or last.sent_ns < self._due_ns or not self._owed.idle_ends_it:
            self._idle.restart()
        elif self._idle.over(late):
            return OwesAnswer(
                f"the controller stands idle and still owes {self._owed.what}{self._said}",
                f"an answer within {IDLE:g} s after the motion has ended",
                "check cable and ground (an answer was lost or damaged on its way) and the firmware (it may have "
                "stalled), then start again",
            )
        if self._late.over(late):
            return DeviceError(
                f"waited {self._owed.limit:g} s for {self._owed.what}{self._said}; the controller's last state is "
                f"{last.state if last else 'unknown'}",
                "a controller that answers in time",
                "look at the machine; reset it if it hangs, and record again",
            )
        return None

    @property
    def _said(self) -> str:
        return f" (it said {', '.join(map(repr, self._owed.heard[:3]))} instead)" if self._owed.heard else ""
