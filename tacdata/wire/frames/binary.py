"""Cuts a byte stream into binary frames."""

from __future__ import annotations

import numpy as np

from tacdata.wire.delivered import StreamCounts
from tacdata.wire.frames.checksum import WIDTHS, checksum
from tacdata.wire.frames.frame_format import BITS, FrameFormat

Fields = dict[str, np.ndarray]
"""Field name -> numbers as float64 (channels) or int64 (counter, timestamp), shape (count,)."""


def widen(values: np.ndarray, kind: str, endianness: str) -> np.ndarray:
    """Convert numbers from their wire type to float64; 24-bit ones come as bytes, shape (count, 3)."""
    if BITS[kind] != 24:
        return values.astype(np.float64)
    parts = values.astype(np.int64)
    low, middle, high = (parts[:, i] for i in ((0, 1, 2) if endianness == "little" else (2, 1, 0)))
    integer = low + (middle << 8) + (high << 16)
    if kind == "int24":
        # Two's complement in 24 bits.
        integer = np.where(integer >= 1 << 23, integer - (1 << 24), integer)
    return integer.astype(np.float64)


def intact(layout: FrameFormat, frame: bytes) -> bool:
    """Whether checksum and trailer are right, for a frame of the right length and sync."""
    body_end = len(layout.sync) + layout.dtype.itemsize
    width = WIDTHS[layout.checksum]
    if frame[body_end + width :] != layout.trailer:
        return False
    covered = frame[:body_end] if layout.covers == "frame" else frame[len(layout.sync) : body_end]
    written = int.from_bytes(frame[body_end : body_end + width], layout.checksum_endianness)
    return not width or written == checksum(layout.checksum, covered)


def fields(layout: FrameFormat, frame: bytes) -> Fields:
    """Return the numbers of an intact frame."""
    record = np.frombuffer(frame, layout.dtype, count=1, offset=len(layout.sync))[0]
    return {name: widen(record[name], layout.type_of(name), layout.endianness) for name in layout.order}


class BinaryFrames:
    """Finds frames by sync and checksum; after damage it searches the next sync, byte by byte.

    Without checksum only the sync of the next frame proves a frame, so frames come one later.
    """

    def __init__(self, layout: FrameFormat, counts: StreamCounts) -> None:
        """Cut by ``layout`` and count damage into ``counts``."""
        self.layout, self.counts = layout, counts
        self.buffer = bytearray()
        self.offset = 0  # of the buffer's first byte in the stream [bytes]
        self.expected = 0  # where the next frame begins if nothing is damaged [bytes]
        self.damaged_until = 0  # end of the last frame counted as corrupt [bytes]

    def push(self, data: bytes) -> list[tuple[Fields, int]]:
        """Take bytes; return each complete frame's fields and the offset of its end in the stream [bytes]."""
        layout, frames = self.layout, []
        # Sync bytes can occur in readings. Without a checksum, only the next frame's sync proves that this one was cut
        # rightly.
        proof = len(layout.sync) if layout.checksum == "none" else 0
        self.buffer += data
        while True:
            at = self.buffer.find(layout.sync)
            if at < 0:
                self._drop(len(self.buffer) - self._partial_sync())
                break
            self._drop(at)
            if len(self.buffer) < layout.size + proof:
                break
            frame = bytes(self.buffer[: layout.size])
            if intact(layout, frame) and (not proof or self.buffer.startswith(layout.sync, layout.size)):
                del self.buffer[: layout.size]
                self.offset += layout.size
                self.expected = self.offset
                frames.append((fields(layout, frame), self.offset))
            else:
                self._reject()
        return frames

    def _reject(self) -> None:
        # A sync inside garbage is no frame: only one where a frame is due counts as corrupt.
        if self.offset == self.expected:
            self.counts.corrupt += 1
            self.expected += self.layout.size
            self.damaged_until = self.expected
        self._drop(1)

    def _partial_sync(self) -> int:
        # Two reads may divide a sync between them.
        sync = self.layout.sync
        return next((n for n in range(len(sync) - 1, 0, -1) if self.buffer.endswith(sync[:n])), 0)

    def _drop(self, count: int) -> None:
        start, end = self.offset, self.offset + count
        self.counts.garbage_bytes += max(0, end - max(start, min(self.damaged_until, end)))
        del self.buffer[:count]
        self.offset = end
