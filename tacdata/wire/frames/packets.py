"""Frames in packets whose end cannot occur in data: SLIP (RFC 1055) and COBS (Cheshire and Baker 1999)."""

from __future__ import annotations

from tacdata.wire.delivered import StreamCounts
from tacdata.wire.frames.binary import Fields, fields, intact
from tacdata.wire.frames.frame_format import FrameFormat

END, ESCAPE, ESCAPED_END, ESCAPED_ESCAPE = 0xC0, 0xDB, 0xDC, 0xDD
"""SLIP's special bytes."""
ENDS = {"slip": bytes([END]), "cobs": b"\0"}
"""End marker of each kind of packet."""


def packed(framing: str, frame: bytes) -> bytes:
    """Return a frame as it goes over the line; unchanged without framing."""
    if framing == "slip":
        escaped = frame.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
        return b"\xc0" + escaped + b"\xc0"
    if framing == "cobs":
        return _cobs(frame) + b"\0"
    return frame


def _cobs(frame: bytes) -> bytes:
    result, parts = bytearray(), frame.split(b"\0")
    for number, part in enumerate(parts):
        # A code byte of 255 stands for 254 bytes without a zero after them; a frame that ends there needs no further
        # block.
        while len(part) >= 254:
            result += b"\xff" + part[:254]
            part = part[254:]
            if not part and number == len(parts) - 1:
                return bytes(result)
        result += bytes([len(part) + 1]) + part
    return bytes(result)


def unpacked(framing: str, packet: bytes) -> bytes | None:
    """Return the frame in a packet without its end marker; None if it breaks the rules."""
    return _from_slip(packet) if framing == "slip" else _from_cobs(packet)


def _from_slip(packet: bytes) -> bytes | None:
    parts = packet.split(bytes([ESCAPE]))
    meaning = {ESCAPED_END: bytes([END]), ESCAPED_ESCAPE: bytes([ESCAPE])}
    result = parts[0]
    for part in parts[1:]:
        if not part or part[0] not in meaning:
            return None
        result += meaning[part[0]] + part[1:]
    return result


def _from_cobs(packet: bytes) -> bytes | None:
    result, at = bytearray(), 0
    while at < len(packet):
        code = packet[at]
        if code == 0 or at + code > len(packet):
            return None
        result += packet[at + 1 : at + code]
        at += code
        # A block of 254 bytes replaces no zero, and the last zero of a frame is not sent.
        if code < 255 and at < len(packet):
            result.append(0)
    return bytes(result)


class PacketFrames:
    """Accepts a packet as a frame if its length, sync, checksum and trailer are right."""

    def __init__(self, layout: FrameFormat, counts: StreamCounts) -> None:
        """Cut by ``layout`` and count damage into ``counts``."""
        self.layout, self.counts = layout, counts
        self.buffer = bytearray()
        self.offset = 0  # of the buffer's first byte in the stream [bytes]
        self.longest = 2 * layout.size + 64
        self.begun = False  # the first packet is received from its middle on

    def push(self, data: bytes) -> list[tuple[Fields, int]]:
        """Take bytes; return each complete frame's fields and the offset of its end in the stream [bytes]."""
        frames, layout = [], self.layout
        self.buffer += data
        while (end := self.buffer.find(ENDS[layout.framing])) >= 0:
            packet = bytes(self.buffer[:end])
            del self.buffer[: end + 1]
            self.offset += end + 1
            # Two markers in a row: the next packet is received from its beginning.
            if not packet:
                self.begun = True
                continue
            frame = unpacked(layout.framing, packet)
            if self._good(frame) and frame is not None:
                frames.append((fields(layout, frame), self.offset))
            # Before the first marker the packet may have begun before the port was opened: that is garbage, not damage.
            elif self.begun and len(packet) <= self.longest:
                self.counts.corrupt += 1
            else:
                self.counts.garbage_bytes += len(packet) + 1
            self.begun = True
        if len(self.buffer) > self.longest:
            self.counts.garbage_bytes += len(self.buffer)
            self.offset += len(self.buffer)
            self.buffer.clear()
            self.begun = False
        return frames

    def _good(self, frame: bytes | None) -> bool:
        layout = self.layout
        right = frame is not None and len(frame) == layout.size and frame.startswith(layout.sync)
        return right and intact(layout, frame or b"")
