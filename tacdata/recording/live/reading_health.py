"""Readings that cannot be, noticed while they arrive: a frozen board, or one with all channels at a limit."""

from __future__ import annotations

import numpy as np

LASTS_NS = 1_000_000_000
"""How long readings must be impossible before it is said [ns of the host's clock]; one frame proves nothing."""
FRAMES = 20
"""... and over how many frames at least [count]."""
RARE = 10
"""A board that has stood still before must stand still this many times as long [1]: coarse readings rest by nature."""
CHANGES = 20
"""Frames that must have changed before a board counts as one whose readings live [count]."""


class ReadingHealth:
    """Follows the frames of one board.

    Example:
        ``health = ReadingHealth((0, 65535)); words = health.take(arrival_ns, counts)``
    """

    def __init__(self, limits: tuple[float, float]) -> None:
        """Begin; ``limits`` [counts] are the least and greatest reading that the frame format can hold."""
        self._limits = limits
        self._last: np.ndarray | None = None
        self._begun_ns = 0
        self._same = self._longest = self._changes = 0

    def take(self, arrival_ns: int, counts: np.ndarray) -> str:
        """Take a frame; return what cannot be, in words, or "".

        Args:
            arrival_ns: Host time of receipt [ns].
            counts: Readings [counts], shape (channels,).
        """
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
        if self._changes >= CHANGES and self._same >= RARE * max(self._longest, 1):
            return f"no channel has changed for {lasted:.1f} s: the board repeats one frame"
        return ""
