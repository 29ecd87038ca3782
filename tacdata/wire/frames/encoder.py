"""Encodes readings as bytes: the board's side of the line, for emulators and tests."""

from __future__ import annotations

import numpy as np

from tacdata.errors import FormatError
from tacdata.wire.frames.ascii import limits
from tacdata.wire.frames.checksum import WIDTHS, checksum
from tacdata.wire.frames.frame_format import BITS, FrameFormat
from tacdata.wire.frames.packets import packed


class Encoder:
    """Encodes frames of one format."""

    def __init__(self, layout: FrameFormat) -> None:
        """Encode frames of a format."""
        self.layout = layout

    def encode(self, counts: np.ndarray, counter: int = 0, ticks: int = 0) -> bytes:
        """Return one frame.

        Args:
            counts: Readings [counts], shape (channels,).
            counter: Frame counter [frames]; wrapped to the wire's width.
            ticks: Board time [ticks]; wrapped likewise.

        Raises:
            FormatError: If the number of readings or their range does not fit the format.
        """
        layout = self.layout
        counts = np.asarray(counts)
        low, high = limits(layout.channel_type)
        fits = counts.shape == (layout.channels,)
        if not fits or np.fmin.reduce(counts) < low or np.fmax.reduce(counts) > high:  # NaN fits
            raise FormatError(
                f"readings of shape {counts.shape} for format {layout.name}",
                f"{layout.channels} numbers from {low:g} to {high:g}",
                "encode readings that the format can hold",
            )
        values = {"channels": counts}
        for name, value in (("counter", counter), ("timestamp", ticks)):
            if name in layout.order:
                values[name] = np.array([value % (1 << BITS[layout.type_of(name)])], dtype=object)
        return self._binary(values) if layout.encoding == "binary" else self._ascii(values)

    def _binary(self, values: dict[str, np.ndarray]) -> bytes:
        layout, body = self.layout, b""
        for name in layout.order:
            kind = layout.type_of(name)
            if kind.startswith("float"):
                arrow = "<" if layout.endianness == "little" else ">"
                body += values[name].astype(f"{arrow}f{BITS[kind] // 8}").tobytes()
                continue
            size, mask = BITS[kind] // 8, (1 << BITS[kind]) - 1
            body += b"".join((int(v) & mask).to_bytes(size, layout.endianness) for v in values[name].tolist())
        covered = layout.sync + body if layout.covers == "frame" else body
        width = WIDTHS[layout.checksum]
        check = checksum(layout.checksum, covered).to_bytes(width, layout.checksum_endianness) if width else b""
        return packed(layout.framing, layout.sync + body + check + layout.trailer)

    def _ascii(self, values: dict[str, np.ndarray]) -> bytes:
        layout, texts = self.layout, []
        for name in layout.order:
            if layout.type_of(name).startswith("float"):
                # Digits that give the same number back when read: 9 for single precision, 17 for double.
                digits = 9 if layout.type_of(name) == "float32" else 17
                texts += [f"{float(v):.{digits}g}" for v in values[name]]
            else:
                texts += [f"{int(v):X}" if layout.radix == 16 else f"{int(v)}" for v in values[name]]
        body = layout.separator.join(text.encode("ascii") for text in texts)
        covered = layout.sync + body if layout.covers == "frame" else body
        width = WIDTHS[layout.checksum]
        check = layout.mark + f"{checksum(layout.checksum, covered):0{2 * width}X}".encode() if width else b""
        return layout.sync + body + check + b"\r\n"
