"""Readings that cannot be, noticed while they arrive: a board that is frozen, at a limit, or slower than it was."""

from __future__ import annotations

from collections import deque

import numpy as np

from tacdata.errors import DeviceError

LASTS_NS = 1_000_000_000
"""How long readings must be impossible before it is reported [ns of the host's clock]; one frame proves nothing."""
FRAMES = 20
"""... and over how many frames at least [count]."""
RARE = 10
"""A board that has stood still before must stand still this many times as long [1]: coarse readings rest by nature."""
CHANGES = 20
"""Frames that must have changed before a board counts as one whose readings live [count]."""


RATE_NS = 1_400_000_000
"""Stretch over which the rate is counted [ns of real time], without its longest gap."""
RATE_EVERY_NS = 150_000_000
"""How often it is counted [ns of real time]; only two low counts in a row are one too many."""
SLOW = 0.6
"""Share of the rate below which a board counts as slow [1]."""
FEWEST = 3
"""Frames in that stretch below which no rate is judged [count]; silence is noticed elsewhere."""


class BadReadings(DeviceError):
    """A board delivers impossible readings."""


class ReadingHealth:
    """Follows the frames of one board.

    Example:
        ``health = ReadingHealth((0, 65535)); words = health.take(arrival_ns, counts)``
    """

    def __init__(self, limits: tuple[float, float], rate: float | None = None, speed: float = 1.0) -> None:
        """Begin.

        Args:
            limits: Least and greatest reading that the frame format can hold [counts].
            rate: Frames per second that the board should send [Hz]; it counts as slow if it falls below its rate at
                first, or below this if that is less.
            speed: Seconds of the clock per second of real time, in which a busy computer delays frames.
        """
        self._limits, self._rate = limits, rate
        self._arrivals: deque[int] = deque()
        self._first_rate: float | None = None
        self._counted_ns, self._low = 0, 0
        self._stretch_ns, self._every_ns = (round(max(speed, 1.0) * ns) for ns in (RATE_NS, RATE_EVERY_NS))
        self._last: np.ndarray | None = None
        self._begun_ns = 0
        self._same = self._longest = self._changes = 0

    def take(self, arrival_ns: int, counts: np.ndarray) -> str:
        """Take a frame; return its impossible values, as a sentence, or "".

        Args:
            arrival_ns: Host time of receipt [ns].
            counts: Readings [counts], shape (channels,).
        """
        return self._frozen(arrival_ns, counts) or self._slow(arrival_ns)

    def _frozen(self, arrival_ns: int, counts: np.ndarray) -> str:
        if self._last is None or not np.array_equal(counts, self._last):
            self._changes += self._last is not None
            if self._changes:
                self._longest = max(self._longest, self._same)
            self._last, self._begun_ns, self._same = counts, arrival_ns, 0
            return ""
        self._same += 1
        lasted = (arrival_ns - self._begun_ns) * 1e-9
        if self._same < FRAMES or arrival_ns - self._begun_ns < LASTS_NS:
            return ""
        if len(counts) > 1 and (np.all(counts <= self._limits[0]) or np.all(counts >= self._limits[1])):
            return f"all {len(counts)} channels have read {counts[0]:g} counts, their limit, for {lasted:.1f} s"
        # A coarse board repeats frames at rest by rounding. Only a repetition far longer than any before is a frozen
        # one.
        if self._changes >= CHANGES and self._same >= RARE * max(self._longest, 1):
            return f"no channel has changed for {lasted:.1f} s: the board repeats one frame"
        return ""

    def _slow(self, arrival_ns: int) -> str:
        arrivals = self._arrivals
        arrivals.append(arrival_ns)
        if arrival_ns - arrivals[0] < self._stretch_ns or arrival_ns - self._counted_ns < self._every_ns:
            return ""
        self._counted_ns = arrival_ns
        while len(arrivals) > 1 and arrival_ns - arrivals[1] >= self._stretch_ns:
            arrivals.popleft()
        # One long gap is a stall of this computer, or silence; a board that became slow has gaps everywhere.
        gaps = np.diff(np.array(arrivals, np.int64))
        span = (arrivals[-1] - arrivals[0] - int(gaps.max())) * 1e-9
        if len(gaps) <= FEWEST or span <= 0.0:
            return ""
        rate = (len(gaps) - 1) / span
        if self._first_rate is None:
            self._first_rate = min(rate, self._rate) if self._rate else rate
        self._low = self._low + 1 if rate < SLOW * self._first_rate else 0
        # Once may be a busy moment of this computer.
        if self._low < 2:
            return ""
        return f"frames come at {rate:.3g} Hz, no longer at {self._first_rate:.3g} Hz"
