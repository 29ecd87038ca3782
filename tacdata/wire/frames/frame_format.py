"""A board's frame format as immutable data, read from its file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.wire.frames.checksum import WIDTHS

BITS = {f"{sign}int{bits}": bits for bits in (8, 16, 24, 32) for sign in ("", "u")}
BITS |= {"uint64": 64, "float32": 32, "float64": 64}
"""Width of each wire type [bits]."""


@dataclass(frozen=True)
class FrameFormat:
    """Layout of one frame on the wire."""

    name: str
    encoding: str
    """``binary`` or ``ascii``."""
    endianness: Literal["little", "big"]
    """``little`` or ``big``: numbers of a binary frame."""
    sync: bytes
    """Bytes at the beginning of every frame; may be empty in ascii."""
    order: tuple[str, ...]
    """Order of ``counter``, ``timestamp``, ``channels`` after the sync."""
    counter: str | None
    """Integer type of the frame counter; None if the board sends none."""
    timestamp: str | None
    """Integer type of the board's time stamp; None if the board sends none."""
    tick: float
    """Seconds per tick of the timestamp [s]."""
    channels: int
    """Channels in a frame."""
    channel_type: str
    """Type of one reading."""
    checksum: str
    """Kind, a name in `tacdata.wire.frames.checksum.WIDTHS`."""
    checksum_endianness: Literal["little", "big"]
    """Byte order of a binary frame's checksum."""
    covers: str
    """``fields`` or ``frame``: whether the checksum covers the sync too."""
    framing: str
    """``none``, ``slip`` or ``cobs``: how binary frames are separated, besides by their sync."""
    mark: bytes
    """Text before the checksum of an ascii line."""
    trailer: bytes
    """Constant bytes after the checksum of a binary frame."""
    separator: bytes
    """Separator between the numbers of an ascii line."""
    radix: int
    """Base of the numbers of an ascii line."""
    rate: float
    """Nominal frame rate [Hz]."""
    document: dict[str, Any]
    """The file's document, as attached to recordings."""

    def type_of(self, field: str) -> str:
        """Return the wire type of ``counter``, ``timestamp`` or ``channels``."""
        return {"counter": self.counter, "timestamp": self.timestamp}.get(field) or self.channel_type

    @cached_property
    def dtype(self) -> np.dtype:
        """The fields of a binary frame as a packed structure; 24-bit numbers appear as 3 bytes."""
        arrow = "<" if self.endianness == "little" else ">"
        parts = []
        for field in self.order:
            kind, count = self.type_of(field), self.channels if field == "channels" else 1
            # NumPy has no numbers of 24 bits.
            base = "u1" if BITS[kind] == 24 else f"{arrow}{kind[0]}{BITS[kind] // 8}"
            parts.append((field, base, (count, 3) if BITS[kind] == 24 else (count,)))
        return np.dtype(parts)

    @property
    def size(self) -> int:
        """Bytes of a binary frame."""
        return len(self.sync) + self.dtype.itemsize + WIDTHS[self.checksum] + len(self.trailer)


def from_document(document: dict[str, Any], origin: str) -> FrameFormat:
    """Build a frame format from a parsed file; ``origin`` names it in errors.

    Raises:
        FormatError: If the document breaks the schema or its parts contradict each other.
    """
    documents.check(document, "frame_format", origin)
    present = [name for name in ("counter", "timestamp", "channels") if name in document]
    order = document.get("order", present)
    binary = document["encoding"] == "binary"
    sync = document.get("sync", [] if "framing" in document else "")
    _check_consistency(document, origin, present, order)
    timestamp, check = document.get("timestamp"), document.get("checksum", {"kind": "none"})
    return FrameFormat(
        name=document["name"],
        encoding=document["encoding"],
        endianness=document.get("endianness", "little"),
        sync=bytes(sync) if binary else sync.encode("ascii"),
        order=tuple(order),
        counter=document.get("counter"),
        timestamp=timestamp["type"] if timestamp else None,
        tick=timestamp["tick"] if timestamp else 0.0,
        channels=document["channels"]["count"],
        channel_type=document["channels"]["type"],
        checksum=check["kind"],
        checksum_endianness=check.get("endianness", document.get("endianness", "little")),
        covers=check.get("covers", "fields"),
        framing=document.get("framing", "none"),
        mark=check.get("mark", "*").encode("ascii"),
        trailer=bytes(document.get("trailer", [])),
        separator=document.get("separator", ",").encode("ascii"),
        radix=document.get("radix", 10),
        rate=float(document["rate"]),
        document=document,
    )


def _check_consistency(document: dict[str, Any], origin: str, present: list[str], order: list[str]) -> None:
    binary = document["encoding"] == "binary"
    sync = document.get("sync", [] if "framing" in document else "")
    if "framing" in document and not binary:
        raise FormatError(
            f"{origin}: framing {document['framing']} in an ascii format",
            "framing of a binary format only",
            "remove framing; lines tell ascii frames apart",
        )
    if binary != isinstance(sync, list):
        raise FormatError(
            f"{origin}: sync {sync!r} in a {document['encoding']} format",
            "a list of bytes in a binary format, a text in an ascii one",
            "correct sync or encoding",
        )
    if sorted(order) != sorted(present):
        raise FormatError(
            f"{origin}: order names {', '.join(order)}; the format has {', '.join(present)}",
            "each field that exists, once",
            "correct order, or describe the missing field",
        )
    texts = (document.get("separator", ","), document.get("checksum", {}).get("mark", "*"), "" if binary else sync)
    if not all(text.isascii() and "\n" not in text for text in texts):
        raise FormatError(f"{origin}: {texts!r}", "plain ASCII without a line break", "correct sync, separator or mark")
    kind = document["channels"]["type"]
    if document.get("radix", 10) == 16 and kind.startswith("float"):
        raise FormatError(f"{origin}: {kind} channels with radix 16", "radix 10 for numbers like 1.5", "correct radix")


def read_format(path: StrPath) -> FrameFormat:
    """Read a frame format file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    path = Path(path)
    return from_document(documents.read(path, "frame_format"), str(path))


def default_format() -> FrameFormat:
    """Return the default format of a 24-channel board (`tacdata/wire/cap24.yaml`)."""
    text = (files("tacdata.wire") / "cap24.yaml").read_text()
    return from_document(documents.parsed(text, "cap24.yaml"), "cap24.yaml")
