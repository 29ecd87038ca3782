"""Cuts a byte stream into lines of numbers."""

from __future__ import annotations

import numpy as np

from tacdata.wire.delivered import StreamCounts
from tacdata.wire.frames.binary import Fields
from tacdata.wire.frames.checksum import checksum
from tacdata.wire.frames.frame_format import BITS, FrameFormat


def limits(kind: str) -> tuple[float, float]:
    """Return the smallest and largest number of a wire type."""
    if kind.startswith("float"):
        return -float(np.finfo(kind).max), float(np.finfo(kind).max)
    bits = BITS[kind]
    return (0, 2**bits - 1) if kind[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


class AsciiLines:
    """Accepts a line as a frame if its sync text, checksum, number of fields and their ranges are right."""

    def __init__(self, layout: FrameFormat, counts: StreamCounts) -> None:
        """Cut by ``layout`` and count damage into ``counts``."""
        self.layout, self.counts = layout, counts
        self.buffer = bytearray()
        self.offset = 0  # of the buffer's first byte in the stream [bytes]
        self.longest = 64 + 16 * (layout.channels + 2)
        # Without sync text and checksum, a line cut at its beginning looks whole. So the first one is dropped.
        self.unproven = not layout.sync and layout.checksum == "none"

    def push(self, data: bytes) -> list[tuple[Fields, int]]:
        """Take bytes; return each complete frame's fields and the offset of its end in the stream [bytes]."""
        frames = []
        self.buffer += data
        while (end := self.buffer.find(b"\n")) >= 0:
            line = bytes(self.buffer[:end])
            del self.buffer[: end + 1]
            self.offset += end + 1
            if (fields := self._line(line)) is not None:
                frames.append((fields, self.offset))
        # No line of this format is as long: the baud rate is wrong, or line ends were lost.
        if len(self.buffer) > self.longest:
            self.counts.garbage_bytes += len(self.buffer)
            self.offset += len(self.buffer)
            self.buffer.clear()
            # Without sync or checksum the end of a cut line looks like a whole one, so the next line is dropped.
            self.unproven = not self.layout.sync and self.layout.checksum == "none"
        return frames

    def _line(self, line: bytes) -> Fields | None:
        layout, text = self.layout, line.strip(b"\r \t")
        if not text:
            return None
        # The last sync: a line may follow the remains of one that was cut off.
        start = text.rfind(layout.sync) if layout.sync else 0
        if start < 0 or self.unproven:
            self.unproven = False
            self.counts.garbage_bytes += len(line) + 1
            return None
        self.counts.garbage_bytes += start
        fields = self._fields(text[start:])
        if fields is None:
            self.counts.corrupt += 1
        return fields

    def _fields(self, text: bytes) -> Fields | None:
        layout = self.layout
        if layout.checksum != "none":
            text, mark, written = text.rpartition(layout.mark)
            covered = text if layout.covers == "frame" else text[len(layout.sync) :]
            value = _number(written, 16)
            if not mark or value is None or value != checksum(layout.checksum, covered):
                return None
        body = text[len(layout.sync) :]
        parts = body.split() if layout.separator.isspace() else body.strip(layout.separator).split(layout.separator)
        if len(parts) != layout.channels + len(layout.order) - 1:
            return None
        return self._numbers(parts)

    def _numbers(self, parts: list[bytes]) -> Fields | None:
        layout, fields, at = self.layout, {}, 0
        for name in layout.order:
            count, kind = (layout.channels if name == "channels" else 1), layout.type_of(name)
            low, high = limits(kind)
            radix = 0 if kind.startswith("float") else layout.radix
            values = [_number(part, radix) for part in parts[at : at + count]]
            # A board may send nan for a missing number; that is kept, and `tacdata check` reports it.
            if any(v is None or not (low <= v <= high or v != v) for v in values):
                return None
            fields[name] = np.array(values, dtype=np.float64)
            at += count
        return fields


def _number(text: bytes, radix: int) -> float | None:
    # int() and float() take underscores and other alphabets' digits; a wire does not.
    allowed = b"0123456789+-." + (b"abcdefABCDEF" if radix == 16 else b"eE" if radix == 0 else b"")
    text = text.strip()
    if radix == 0 and text.lower() == b"nan":
        return float("nan")
    if not text or text.strip(allowed):
        return None
    try:
        return int(text, radix) if radix else float(text)
    except ValueError:
        return None
