"""Judges a controller's silence: gone, unreadable, or not read in time."""

from __future__ import annotations

import serial

from tacdata.clock import Clock
from tacdata.errors import DeviceError
from tacdata.wire.patience import EMULATED, Lateness, Patience, while_late
from tacdata.wire.serial_port import bytes_waiting

SILENCE = 3.0
"""Time without an answer after which the controller counts as gone [s of the clock, and of real time]."""
EMULATOR = "see whether the virtual rig still runs; end other programs on this computer, or lower its --speed"
READ = 0.05
"""Timeout of one read [s, real time]."""


class Silence:
    """The time since a controller's latest report, and the unreadable line since then.

    Example:
        ``silence = Silence(port, clock, 8.0)``; in the reader's loop ``silence.look()``, after each report
        ``silence.restart()``; then ``silence.ending()`` is the fault or None
    """

    def __init__(self, port: serial.SerialBase, clock: Clock, poll_rate: float) -> None:
        """Begin; `ending` is asked ``poll_rate`` times a second of ``clock``."""
        self._port, self._is_emulated = port, clock.rate > 1.0 or clock.host.longest_wait > 0
        self.seconds = EMULATED if self._is_emulated else SILENCE
        """Time without an answer that is a fault [s]."""
        # Gaps of two polls are normal; only time beyond them counts.
        step = max(0.25, 2.0 / (poll_rate * clock.rate))
        self._patience = Patience(self.seconds, clock.rate, self.seconds, step, clock.host)
        self._reader = Lateness(2 * READ, clock.host)
        self.unread = ""
        """The latest line that could not be read, since a report that could."""

    def restart(self) -> None:
        """Begin again, after a report that could be read."""
        self.unread = ""
        self._patience.restart()

    def hold(self) -> None:
        """Count no silence so far. A homing Grbl 1.1 answers nothing."""
        self._patience.restart()

    def look(self, received: bool) -> None:
        """Take that the reader runs. ``received``: whether anything came."""
        self._reader.look()
        if received:
            self._reader.restart()

    @property
    def late(self) -> float:
        """Lateness of this computer in reading bytes that wait in the port [s, real time].

        An emulated controller runs on this computer: then any lateness counts.
        """
        return self._reader.seconds if self._is_emulated or bytes_waiting(self._port) else 0.0

    def ending(self) -> tuple[DeviceError, bool] | None:
        """Return the fault of a long silence, and whether the position is lost; or None."""
        delay = self.late
        if not self._patience.over(delay):
            return None
        controller, busy = f"the controller on {self._port.port}", while_late(delay)
        # The answers are there: this computer is late, and the position is still known.
        if bytes_waiting(self._port):
            cause = f"{controller} has answered, and nothing was read for {self.seconds:g} s{busy}"
            remedy = "end other programs on this computer, then start again"
            return DeviceError(cause, "a computer that reads what arrives", remedy), False
        if self.unread:  # it is there, and a report that can be read may come again
            cause = f"{controller} sends reports that cannot be read: {self.unread!r}"
            remedy = "check cable, ground and baud rate, then start again"
            return DeviceError(cause, "reports with a position in numbers", remedy), False
        cause = f"{controller} is silent: no answer to ? for {self.seconds:g} s{busy}"
        look = EMULATOR if self._is_emulated else "check power and cable"
        remedy = f"{look}; the position is unknown, home or touch off again"
        return DeviceError(cause, f"an answer to ? within {self.seconds:g} s", remedy), True
