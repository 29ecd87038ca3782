"""A limit on waiting that counts only the time during which this process runs."""

from __future__ import annotations

import time

REAL_FLOOR = 1.0
"""No wait for a device gives up sooner than this [s, real time], however fast the clock runs."""
STEP = 0.25
"""What one look may add at most [s, real time]: whoever waits looks far more often, unless the host stands still."""


class Patience:
    """Runs out after a time of waking waiting.

    A host that stands still (a closed lid, SIGSTOP, an overloaded machine) hears nothing meanwhile, and what it
    missed waits in the system's buffers. So a gap between two looks counts as one step, not as silence of the
    device: after a stall there is time to ask before anything is judged.

    Example:
        ``patience = Patience(3.0)``; in a loop ``if patience.over(): raise ...``
    """

    def __init__(self, seconds: float, rate: float = 1.0, floor: float = REAL_FLOOR, step: float = STEP) -> None:
        """Allow ``seconds`` [s of a clock that runs at ``rate``], and never less than ``floor`` [s, real time].

        ``step`` [s, real time] should be longer than the time between two looks.
        """
        self._limit, self._step = max(seconds / rate, floor), step
        self.restart()

    def restart(self) -> None:
        """Begin anew, as something was heard."""
        self._waited, self._looked = 0.0, time.monotonic()

    def over(self) -> bool:
        """Look at the clock; say whether the time is up."""
        now = time.monotonic()
        self._waited += min(now - self._looked, self._step)
        self._looked = now
        return self._waited > self._limit
