"""What the controller owes: every wait for it has a reason, a limit and an ending in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tacdata.clock import Clock
from tacdata.errors import DeviceError
from tacdata.wire.delivered import CncStatus
from tacdata.wire.patience import REAL_FLOOR, Patience

IDLE, IDLE_FLOOR = 2.0, 1.5
"""How long an idle controller may owe an answer after its motion should have ended [s of the clock], and the least of
it [s, real time]. Idle means that nothing runs that could hold the answer back; a pause (G4) counts as motion here."""
FLOOR = 3.0
"""Least wait for a line's answer [s, real time], so that an idle controller is found to be one first."""


@dataclass(frozen=True)
class Owed:
    """One thing that is waited for."""

    what: str
    """In words, for example "an answer to 'G4P0.01'"."""
    limit: float
    """Longest wait [s of the clock]."""
    motion: float = 0.0
    """What the motion and pauses queued before it may take [s of the clock]."""
    heard: Sequence[str] = ()
    """What was said meanwhile that is no answer; read when the wait ends."""
    idle_ends_it: bool = False
    """Whether an idle controller cannot come to it any more."""

    def watch(self, clock: Clock) -> Watch:
        """Begin to wait."""
        return Watch(self, clock)


class Watch:
    """Watches over one wait; its user looks several times a second, with the latest report."""

    def __init__(self, owed: Owed, clock: Clock) -> None:
        """Begin now."""
        self._owed, self._clock = owed, clock
        self._due_ns = clock.now_ns() + round(min(owed.motion, owed.limit) * 1e9)
        self._late = Patience(owed.limit, clock.rate, floor=FLOOR if owed.idle_ends_it else REAL_FLOOR)
        self._idle = Patience(IDLE, clock.rate, floor=IDLE_FLOOR)

    def ending(self, last: CncStatus | None) -> DeviceError | None:
        """Return why the wait has to end, or None."""
        if last is None or last.state != "Idle" or last.sent_ns < self._due_ns or not self._owed.idle_ends_it:
            self._idle.restart()
        elif self._idle.over():
            return DeviceError(
                f"the controller stands idle and still owes {self._owed.what}{self._said}",
                f"an answer within {IDLE:g} s after the motion has ended",
                "check cable and ground (an answer was lost or damaged on its way) and the firmware (it may have "
                "stalled), then start again",
            )
        if self._late.over():
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
