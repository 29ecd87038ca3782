"""Timeouts that count only the waking time of this process. The lateness of its readers."""

from __future__ import annotations

from tacdata.host import COMPUTER, Host

REAL_FLOOR = 1.0
"""Shortest timeout of any wait for a device [s, real time], however fast the clock runs."""
STEP = 0.25
"""Largest time that one check adds [s, real time]. Checks are far more frequent, unless the host is stopped."""

LATE = 0.5
"""Lateness of this computer that is named in a fault [s, real time]."""
EMULATED = 5.0
"""Shortest silence of an emulated device [s, real time]. It runs on this computer, and a busy one delays it."""


class Lateness:
    """Lateness of this computer in reading one stream, since its latest data.

    Example:
        ``lateness = Lateness(0.1)``; in the reader's loop ``lateness.look()``, and ``restart()`` after data
    """

    def __init__(self, pause: float, host: Host = COMPUTER) -> None:
        """Begin; ``pause`` [s, real time] is the longest usual time between two looks."""
        self._host, self._pause, self._looked, self._sum = host, pause, host.monotonic(), 0.0

    def look(self) -> None:
        """Take that the reader runs now."""
        instant = self._host.monotonic()
        self._sum, self._looked = self._sum + max(instant - self._looked - self._pause, 0.0), instant

    def restart(self) -> None:
        """Restart, because something was received."""
        self._sum = 0.0

    @property
    def seconds(self) -> float:
        """All pauses of the reader beyond the usual one, the present one included [s, real time]."""
        return self._sum + max(self._host.monotonic() - self._looked - self._pause, 0.0)


def while_late(seconds: float) -> str:
    """Return a lateness [s, real time] in words; empty if it is small."""
    return f", while this computer was {seconds:.1f} s late in reading" if seconds > LATE else ""


class Patience:
    """A timeout in waking time.

    A stopped host (a closed lid, SIGSTOP, overload) receives nothing in the meantime, and the missed bytes wait in the
    system's buffers. So a gap between two checks counts as one step, not as silence of the device. After a stall there
    is time to ask before anything is judged.

    Example:
        ``patience = Patience(3.0)``; in a loop ``if patience.over(): raise ...``
    """

    def __init__(
        self, seconds: float, rate: float = 1.0, floor: float = REAL_FLOOR, step: float = STEP, host: Host = COMPUTER
    ) -> None:
        """Allow ``seconds`` [s of a clock that runs at ``rate``], and never less than ``floor`` [s, real time].

        ``step`` [s, real time] should be longer than the time between two looks. ``host`` gives the time.
        """
        self._host, self._limit, self._step = host, max(seconds / rate, floor), step
        self.restart()

    def restart(self) -> None:
        """Restart, because something was received."""
        self._waited, self._looked = 0.0, self._host.monotonic()

    def over(self, late: float = 0.0) -> bool:
        """Check the clock; return whether the time is up.

        Args:
            late: Lateness in reading [s, real time]. It extends the timeout, and at most doubles it.
        """
        instant = self._host.monotonic()
        self._waited += min(instant - self._looked, self._step)
        self._looked = instant
        return self._waited > self._limit + min(late, self._limit)
