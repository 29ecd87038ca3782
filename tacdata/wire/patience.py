"""A timeout that counts only the time during which this process runs."""

from __future__ import annotations

from tacdata.host import COMPUTER, Host

REAL_FLOOR = 1.0
"""Shortest timeout of any wait for a device [s, real time], however fast the clock runs."""
STEP = 0.25
"""Largest time that one check adds [s, real time]. Checks are far more frequent, unless the host is stopped."""


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

    def over(self) -> bool:
        """Check the clock; return whether the time is up."""
        instant = self._host.monotonic()
        self._waited += min(instant - self._looked, self._step)
        self._looked = instant
        return self._waited > self._limit
