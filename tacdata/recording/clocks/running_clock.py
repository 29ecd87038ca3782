"""The clock of one stream while it is recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tacdata.recording.clocks.clock_model import ClockModel, StreamLatency
from tacdata.recording.clocks.envelope_fit import EnvelopeFit

REFIT = 8
"""Frames between two updates of the line while recording; the stored model uses all frames."""
TAP_MIDDLE_NS = 10_000_000_000
"""Time from the middle of a sync tap to its end [ns]."""


class StreamClock:
    """Takes every arrival of a stream and returns its sample time by the clock known so far."""

    def __init__(self, axis: str = "counter", rate: float = 1.0, nominal_ns: float | None = None) -> None:
        """Begin without arrivals; ``axis``, ``rate`` and ``nominal_ns`` as in `EnvelopeFit`."""
        self.axis, self.rate = axis, rate
        self.latency: StreamLatency | None = None
        """The link's smallest delay, once measured, against the line as it is known now."""
        self._fit = EnvelopeFit(axis, rate, nominal_ns)
        self._line: tuple[int, int, float] | None = None
        self._measured: tuple[StreamLatency, int, int] | None = None  # with a counter, and where the line was then [ns]
        self._steady = self._was_steady = True  # whether the line can be used: now, and when the latency was measured
        self.frames = 0
        """Arrivals taken."""

    def take(self, arrival_ns: int, counter: int) -> int:
        """Take one arrival [ns] of a counter [frames] or device time [ns]; return its sample time [ns].

        Without a counter (-1), or before the line is known, that is the arrival.
        """
        if counter >= 0:
            self._fit.add(arrival_ns, counter)
            # A fit costs more than an arrival, and the line changes slowly.
            if self.frames % REFIT == 0 or self._line is None:
                self._line = self._fit.line()
                if self.axis == "order":  # only numbers given on arrival may not fit a line
                    self._look(self._fit.model())
                self._follow()
            self.frames += 1
        constant = self.latency.latency_ns if self.latency else 0
        if counter < 0 or self._line is None or not self._steady:
            return arrival_ns - constant
        origin, host_ns, period = self._line
        # No reading is taken after its arrival, even where the line is still too high.
        return min(host_ns + round(period * (counter - origin)), arrival_ns) - constant

    def set_latency(self, latency: StreamLatency | None) -> None:
        """Take a constant latency that a sync tap has just measured against the present line, or None.

        Later arrivals with less latency let the line sink. The stored position at the tap shows by how much, and the
        latency over the line is reduced by that. Without a usable line (a camera that skips images) it was measured
        against the arrivals. It holds as long as that is so.
        """
        self.latency, self._measured = latency, None
        self._look(self._fit.model())
        self._was_steady = self._steady
        line = self._fit.line()
        if latency is not None and line is not None:
            # A latency measured against a line that is later found lower has to follow it, or sample times would jump.
            counter = max(self._fit.last_counter - round(TAP_MIDDLE_NS / line[2]), line[0])
            self._measured = latency, counter, _at(line, counter)

    def _look(self, model: ClockModel | None) -> None:
        self._steady = model is None or model.steady

    def _follow(self) -> None:
        if self._measured is None or self._line is None:
            return
        latency, counter, host_ns = self._measured
        self.latency = latency if self._steady is self._was_steady else None
        if self._steady and self.latency is not None and self._fit.remembers(counter):
            sunk = host_ns - _at(self._line, counter)
            self.latency = replace(latency, latency_ns=latency.latency_ns - sunk)

    def model(self) -> ClockModel | None:
        """Return the model of all arrivals, or None before two counters are known."""
        model = self._fit.model()
        if model is None:
            return None
        self._line = self._fit.line()
        self._look(model)
        self._follow()
        return model.with_latency(self.latency)


def _at(line: tuple[int, int, float], counter: int) -> int:
    return line[1] + round(line[2] * (counter - line[0]))


def nominal_period_ns(board: dict[str, Any]) -> float | None:
    """Return the time between frames [ns] by a board's description of itself; None if it names none."""
    rate = board.get("rate", {}).get("nominal")
    return 1e9 / rate if rate else None
