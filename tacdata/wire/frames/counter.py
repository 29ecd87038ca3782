"""Follows a frame counter that wraps: losses, repeats, restarts."""

from __future__ import annotations

from tacdata.wire.delivered import StreamCounts

REPEAT_WINDOW = 8
"""A step back of at most this many frames is a frame sent again; a longer one is a restart [frames]."""


class CounterTrack:
    """Unwraps a frame counter.

    The counter alone cannot distinguish a restarted board from a loss. A jump ahead by more than 10 s, longer than the
    time since the first frame allows, counts as a restart and is noted.
    """

    def __init__(self, modulus: int, rate: float, counts: StreamCounts) -> None:
        """Follow a counter that runs from 0 to ``modulus`` - 1 at ``rate`` [Hz]."""
        self.modulus, self.rate, self.counts = modulus, rate, counts
        self.margin = max(10 * rate, 64.0)
        self.raw = -1
        self.value = -1
        self.first_value, self.first_ns = -1, 0

    def advance(self, raw: int, arrival_ns: int) -> int | None:
        """Return the unwrapped counter of the next frame, or None if that frame was there before."""
        if self.raw < 0:
            return self._begin(raw, raw, arrival_ns)
        # Modulo, so that a counter that wraps counts on.
        step = (raw - self.raw) % self.modulus
        if step == 0 or self.modulus - step <= min(REPEAT_WINDOW, self.modulus // 4):
            self.counts.repeated += 1
            return None
        # Losses are bounded by the time that has passed: more frames than the rate allows cannot have been sent. The 5
        # % are for boards whose clock is off.
        room = (arrival_ns - self.first_ns) * 1e-9 * self.rate * 1.05 + self.margin
        implausible = step > self.margin and self.value + step - self.first_value > room
        if step > self.modulus // 2 or implausible:
            self.counts.notes.append(
                f"the counter went from {self.raw} to {raw}: it restarted, or lost more than can be counted"
            )
            return self._begin(raw, self.value + 1, arrival_ns)
        self.counts.lost += step - 1
        self.raw, self.value = raw, self.value + step
        return self.value

    def _begin(self, raw: int, value: int, arrival_ns: int) -> int:
        self.raw, self.value = raw, value
        self.first_value, self.first_ns = value, arrival_ns
        return value
