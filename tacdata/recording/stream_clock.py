"""The clock of one stream while it is recorded."""

from __future__ import annotations

from tacdata.recording.clock_fit import EnvelopeFit
from tacdata.recording.clock_model import ClockModel, Latency

REFIT = 8
"""Frames between two looks at the line while recording; the stored model uses all."""


class StreamClock:
    """Takes every arrival of a stream and says when it was sampled, as far as is known by then."""

    def __init__(self, axis: str = "counter", rate: float = 1.0) -> None:
        """Begin without arrivals; ``axis`` and ``rate`` as in `EnvelopeFit`."""
        self.axis = axis
        self.latency: Latency | None = None
        """The link's smallest delay, once measured."""
        self._fit = EnvelopeFit(axis, rate)
        self._line: tuple[int, int, float] | None = None
        self._frames = 0

    def take(self, arrival_ns: int, counter: int) -> int:
        """Take one arrival [ns] of a counter [frames] or device time [ns]; return its sample time [ns].

        Without a counter (-1), or before the line is known, that is the arrival.
        """
        constant = self.latency.latency_ns if self.latency else 0
        if counter < 0:
            return arrival_ns - constant
        self._fit.add(arrival_ns, counter)
        if self._frames % REFIT == 0 or self._line is None:
            self._line = self._fit.line()
        self._frames += 1
        if self._line is None:
            return arrival_ns - constant
        origin, host_ns, period = self._line
        return min(host_ns + round(period * (counter - origin)), arrival_ns) - constant

    def model(self) -> ClockModel | None:
        """Return the model of all arrivals, or None before two counters are known."""
        model = self._fit.model()
        return model.with_latency(self.latency) if model else None
