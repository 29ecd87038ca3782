"""Decodes received bytes into frames of readings."""

from __future__ import annotations

from collections import deque

from tacdata.wire.delivered import StreamCounts, TaxelFrame
from tacdata.wire.frames.ascii import AsciiLines
from tacdata.wire.frames.binary import BinaryFrames
from tacdata.wire.frames.counter import CounterTrack
from tacdata.wire.frames.frame_format import BITS, FrameFormat
from tacdata.wire.frames.packets import PacketFrames


class Decoder:
    """Decodes one board's stream; keeps incomplete frames between calls and never invents a reading.

    ``counts`` holds frames received, lost (by the counter), repeated (and dropped) and corrupt, and bytes skipped.

    Example:
        >>> import numpy as np
        >>> from tacdata.wire.frames.decoder import Decoder
        >>> from tacdata.wire.frames.encoder import Encoder
        >>> from tacdata.wire.frames.frame_format import default_format
        >>> board = Encoder(default_format())
        >>> sent = [board.encode(np.arange(24.0), counter=k, ticks=0) for k in (7, 8, 10)]
        >>> decoder = Decoder(default_format())
        >>> frames = decoder.feed(b"".join(sent), arrival_ns=0)
        >>> [frame.counter for frame in frames], decoder.counts.lost
        ([7, 8, 10], 1)
    """

    def __init__(self, layout: FrameFormat) -> None:
        """Decode frames of a format."""
        self.layout = layout
        self.counts = StreamCounts()
        cutter = AsciiLines if layout.encoding == "ascii" else BinaryFrames
        self._frames = (PacketFrames if layout.framing != "none" else cutter)(layout, self.counts)
        modulus = 1 << BITS[layout.counter] if layout.counter else 0
        self._counter = CounterTrack(modulus, layout.rate, self.counts) if modulus else None
        self._received = 0
        self._arrivals: deque[tuple[int, int]] = deque()
        self._ticks: int | None = None

    def feed(self, data: bytes, arrival_ns: int) -> list[TaxelFrame]:
        """Take bytes received at ``arrival_ns`` [ns]; return the frames that they complete."""
        self._received += len(data)
        # A frame may end in the middle of a read. Its time is that of the read which brought its last byte.
        self._arrivals.append((self._received, arrival_ns))
        frames = []
        for fields, end in self._frames.push(data):
            arrival = self._arrival_of(end)
            ticks = self._unwrap(int(fields["timestamp"][0])) if "timestamp" in fields else None
            counter = -1
            if self._counter:
                value = self._counter.advance(int(fields["counter"][0]), arrival)
                # A frame sent twice is one sample. Kept twice, it would count as two independent readings.
                if value is None:
                    continue
                counter = value
            self.counts.received += 1
            device_ns = -1 if ticks is None else round(ticks * self.layout.tick * 1e9)
            frames.append(TaxelFrame(arrival, counter, fields["channels"], device_ns))
        while self._arrivals and self._arrivals[0][0] <= self._frames.offset:
            self._arrivals.popleft()  # of bytes that are cut already, into frames or garbage
        return frames

    def _arrival_of(self, end: int) -> int:
        # A frame may be proven only by later bytes: its time is that of the chunk with its own last byte.
        while self._arrivals[0][0] < end:
            self._arrivals.popleft()
        return self._arrivals[0][1]

    def _unwrap(self, raw: int) -> int:
        modulus = 1 << BITS[self.layout.timestamp or "uint32"]
        self._ticks = raw if self._ticks is None else self._ticks + (raw - self._ticks) % modulus
        return self._ticks
