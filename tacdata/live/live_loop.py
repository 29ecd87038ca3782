"""Reads a board, estimates, and passes the estimates on: to a socket, a viewer, a person."""

import time
from collections.abc import Callable
from typing import Any

from tacdata.demonstrations.touch import ALIEN
from tacdata.live.depth_stream import DepthStream, Estimate
from tacdata.live.latency_meter import LatencyMeter
from tacdata.live.message_server import MessageServer, message
from tacdata.live.source import Source

PATIENCE = 0.05
"""Timeout of a read [s of the host's clock]."""
LATE = 2.0
"""A frame that waited longer [frame periods] is estimated only if no newer one is there."""
TOUCHED = "the skin was touched while it was tared; lift what touches it and tare again (Enter, or tare on the socket)"
"""Meaning of a reading below the tare."""
SAID_EVERY = 1.0
"""Interval between status lines for a person [s of real time]."""


class LiveLoop:
    """Runs until it is stopped."""

    def __init__(
        self,
        source: Source,
        stream: DepthStream,
        network: str,
        server: MessageServer | None = None,
        watch: Callable[[str, int, Any], None] | None = None,
        maps: bool = True,
    ) -> None:
        """Prepare.

        Args:
            source: The opened board.
            stream: Makes estimates of its frames.
            network: Identity of the network, for messages.
            server: Takes messages.
            watch: Called with every estimate (`viewers.live.window`); must return at once.
            maps: Whether messages hold whole maps.
        """
        self._source, self._stream, self._server, self._watch, self._maps = source, stream, server, watch, maps
        self._about = {
            "finger": source.name,
            "network": network,
            "causal": stream.causal,
            "lookahead": stream.lookahead,
        }
        self.meter = LatencyMeter()
        self.skipped = 0
        """Estimates left out because computing did not keep up."""
        self._stopped = self._tare_wanted = False
        if server is not None:
            server.tare = self.tare

    def tare(self) -> None:
        """Tare again before the next frame; safe in any thread."""
        self._tare_wanted = True

    def stop(self) -> None:
        """End `run` soon; safe in any thread and signal handler."""
        self._stopped = True

    def run(self, seconds: float | None, say: Callable[[str], None]) -> None:
        """Read until stopped, or for so long [s of real time].

        Raises:
            DeviceError: If the board breaks.
        """
        begun = sentences = time.monotonic()
        while not self._stopped and (seconds is None or time.monotonic() - begun < seconds):
            if self._tare_wanted:
                self._tare_wanted = False
                self._stream.tare()
                say(f"{self._source.name}: taring again, do not touch the skin")
            frames = self._source.board.read(PATIENCE)
            for frame in frames:
                # When late, only the newest estimate helps a controller; the others would make it later still.
                is_late = self._source.clock.now_ns() - frame.arrival_ns > LATE * 1e9 / self._source.rate
                is_needed = not is_late or frame is frames[-1]
                self.skipped += not is_needed and self._stream.baseline is not None
                estimate = self._stream.push(frame, is_needed)
                if estimate is not None:
                    self._hand_out(estimate)
                is_time = time.monotonic() - sentences >= SAID_EVERY
                if is_time and (words := self._words(estimate) if estimate else self._stream.waiting_for_rest):
                    sentences = time.monotonic()
                    say(words if estimate else f"{self._source.name}: {words}; waiting until nothing moves the skin")

    def _hand_out(self, estimate: Estimate) -> None:
        sent = self._source.clock.now_ns()
        if self._server:
            self._server.send(message(estimate, self._about, sent, self._maps))
        self.meter.take(estimate.sample_ns, estimate.arrival_ns, sent)
        if self._watch:
            self._watch(
                f"depth {self._source.name}", estimate.sample_ns, (estimate.depth, estimate.largest, estimate.centre)
            )

    def _words(self, estimate: Estimate) -> str:
        figures = self.meter.figures
        where = "no contact"
        if estimate.centre is not None:
            where = f"centre {estimate.centre[0]:+.2f}, {estimate.centre[1]:+.2f} mm"
        if estimate.novelty is not None and estimate.novelty > 1:
            word = "a guess" if estimate.novelty > ALIEN else "may be off"
            where += f" ({word}: {estimate.novelty:.1f} times as far from what was learnt as validation presses)"
        if estimate.below_tare:
            where += f"; readings lie {estimate.below_tare:.0f} counts below the tare: {TOUCHED}"
        pace = f"; {figures.rate:.1f} Hz, age {figures.age[0]:.0f} ms (95 %: {figures.age[1]:.0f})" if figures else ""
        return f"{self._source.name}: depth {estimate.largest:.2f} mm, {where}{pace}"
