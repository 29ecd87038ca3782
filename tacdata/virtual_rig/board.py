"""An emulated capacitive board on a virtual port: its own crystal, and the latencies of a USB bridge."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tacdata.clock import Clock
from tacdata.virtual_rig.port import VirtualPort
from tacdata.wire import Encoder, FrameFormat

NS = 1_000_000_000
PACKET = 62
"""Bytes after which an FTDI bridge sends without waiting for its timer."""


@dataclass(frozen=True)
class Timing:
    """When the board samples and how its bytes travel."""

    start_ns: int
    """Time of sample 0 [ns of the host's clock]."""
    period: float
    """Nominal time between samples [s]."""
    drift: float
    """Error of the crystal [ppm]; positive is slow."""
    wander: float
    """Amplitude of the slow deviation of sample times from the straight line [s]."""
    wander_period: float
    """Period of that deviation [s]."""
    conversion: float
    """From sampling to the first bit on the line [s]."""
    timer: float
    """Latency timer of the USB bridge [s]; at least one USB frame, 1 ms."""

    def sample_ns(self, counter: int) -> int:
        """Return the true time of a sample [ns of the host's clock]."""
        seconds = counter * self.period * (1 + self.drift * 1e-6)
        return self.start_ns + round(1e9 * (seconds + self.wander * math.sin(math.tau * seconds / self.wander_period)))


def draw_timing(seed: int, start_ns: int, rate: float) -> Timing:
    """Draw a board's timing from a seed; nominal ``rate`` [Hz]."""
    rng = np.random.default_rng([seed, 3])
    return Timing(start_ns, 1 / rate, float(rng.uniform(-60, 60)), 0.0003, 600.0, 0.001, 0.016)


class VirtualBoard:
    """Samples the world and streams frames, all on the time of ``clock``."""

    def __init__(
        self,
        clock: Clock,
        layout: FrameFormat,
        timing: Timing,
        read: Callable[[int], np.ndarray],
        baud: int = 115200,
        seed: int = 0,
        port: VirtualPort | None = None,
    ) -> None:
        """Stream ``read(sample time [ns]) -> counts, shape (channels,)`` in the given frame format.

        ``port`` is the line to the host, by default a pseudo-terminal.
        """
        self.clock, self.timing, self.baud = clock, timing, baud
        self.port = port or VirtualPort(baud, seed)
        self._encoder, self._read = Encoder(layout), read
        self._rng = np.random.default_rng([seed, 4])
        self._line: deque[tuple[int, int]] = deque()  # (when it has left the board [ns], byte)
        self._packets: deque[tuple[int, bytes]] = deque()
        self._counter = 0
        self._stopped = clock.host.event()
        self._thread = clock.host.thread(self._run, "virtual-board")

    def start(self) -> None:
        """Switch on."""
        self._thread.start()

    def stop(self) -> None:
        """Switch off and unplug."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self.port.close()

    def inject_readings(self, change: Callable[[np.ndarray], np.ndarray]) -> None:
        """Fault: from now on the board sends ``change(readings)`` [counts], shape (channels,)."""
        read = self._read
        self._read = lambda sampled_ns: change(read(sampled_ns))

    def _run(self) -> None:
        while not self._stopped.is_set():
            now_ns = self.clock.now_ns()
            while (following := self.timing.sample_ns(self._counter)) <= now_ns:
                self._sample(following)
            self._bridge(following)
            while self._packets and self._packets[0][0] <= now_ns:
                self.port.write(self._packets.popleft()[1])
            if self.port.waiting:
                self.port.write(b"")
            due = min(following, self._packets[0][0]) if self._packets else following
            self.clock.serve(self.port.path, due)
            self._stopped.wait(max((due - self.clock.now_ns()) / NS / self.clock.rate, 0.0002))
        self.clock.serve(self.port.path, None)

    def _sample(self, sampled: int) -> None:
        frame = self._encoder.encode(self._read(sampled), self._counter, round(sampled / 1000))
        begin, bit = sampled + int(self.timing.conversion * NS), 10 * NS // self.baud
        # Bytes of the frame before may still occupy the line.
        begin = max(begin, self._line[-1][0] if self._line else 0)
        self._line += [(begin + (i + 1) * bit, byte) for i, byte in enumerate(frame)]
        self._counter += 1

    def _bridge(self, before_ns: int) -> None:
        """Return the packets that leave the board before a time: at a tick of the timer, or when a packet is full."""
        timer = max(int(self.timing.timer * NS), 1_000_000)
        while self._line:
            first = self._line[0][0] - self.timing.start_ns
            # Rounded up to a tick: the bridge's timer runs on whether or not bytes come.
            leaves = self.timing.start_ns + -(-first // timer) * timer
            if len(self._line) >= PACKET:
                leaves = min(leaves, self._line[PACKET - 1][0])
            if leaves >= before_ns:  # the next sample may still have bytes for this packet
                return
            data = bytearray()
            while self._line and self._line[0][0] <= leaves and len(data) < PACKET:
                data.append(self._line.popleft()[1])
            jitter = int(self._rng.uniform(0, 0.001) * NS)
            last = self._packets[-1][0] if self._packets else 0
            # The bus delays packets by random times, and never lets one overtake another.
            self._packets.append((max(leaves + jitter, last), bytes(data)))
