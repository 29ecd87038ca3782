"""Checksums by name; each CRC by its Rocksoft parameters (Williams, "A Painless Guide to CRC", 1993)."""

from __future__ import annotations

import binascii
import zlib
from dataclasses import dataclass
from functools import cache


@dataclass(frozen=True)
class Crc:
    """Parameters of one cyclic redundancy check."""

    width: int
    """Width [bits]."""
    polynomial: int
    """Generator without its leading bit."""
    initial: int
    """Register before the first byte."""
    reflected: bool
    """True if bytes and register run least significant bit first."""
    final: int
    """XORed onto the result."""


CRCS = {
    "crc8": Crc(8, 0x07, 0x00, False, 0x00),
    "crc8_maxim": Crc(8, 0x31, 0x00, True, 0x00),
    "crc8_sae_j1850": Crc(8, 0x1D, 0xFF, False, 0xFF),
    "crc16_ccitt_false": Crc(16, 0x1021, 0xFFFF, False, 0x0000),
    "crc16_xmodem": Crc(16, 0x1021, 0x0000, False, 0x0000),
    "crc16_kermit": Crc(16, 0x1021, 0x0000, True, 0x0000),
    "crc16_x25": Crc(16, 0x1021, 0xFFFF, True, 0xFFFF),
    "crc16_modbus": Crc(16, 0x8005, 0xFFFF, True, 0x0000),
    "crc16_arc": Crc(16, 0x8005, 0x0000, True, 0x0000),
    "crc32": Crc(32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF),
    "crc32_mpeg2": Crc(32, 0x04C11DB7, 0xFFFFFFFF, False, 0x00000000),
    "crc32c": Crc(32, 0x1EDC6F41, 0xFFFFFFFF, True, 0xFFFFFFFF),
}
SUMS = {"xor8": 1, "sum8": 1, "lrc8": 1, "sum16": 2, "fletcher16": 2}
"""Kinds that are no CRC, and the bytes that they take."""
WIDTHS = {"none": 0} | SUMS | {name: crc.width // 8 for name, crc in CRCS.items()}
"""Bytes that each kind takes in a frame."""


def _reflect(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


@cache
def _table(crc: Crc) -> tuple[int, ...]:
    top, mask = 1 << (crc.width - 1), (1 << crc.width) - 1
    entries = []
    # One look-up a byte in place of eight shifts.
    for byte in range(256):
        register = (_reflect(byte, 8) if crc.reflected else byte) << (crc.width - 8)
        for _ in range(8):
            register = ((register << 1) ^ crc.polynomial if register & top else register << 1) & mask
        entries.append(_reflect(register, crc.width) if crc.reflected else register)
    return tuple(entries)


def crc_of(crc: Crc, data: bytes) -> int:
    """Return any cyclic redundancy check of ``data`` by its parameters."""
    table, mask = _table(crc), (1 << crc.width) - 1
    register = _reflect(crc.initial, crc.width) if crc.reflected else crc.initial
    for byte in data:
        if crc.reflected:
            register = (register >> 8) ^ table[(register ^ byte) & 0xFF]
        else:
            register = ((register << 8) & mask) ^ table[(register >> (crc.width - 8)) ^ byte]
    return register ^ crc.final


def checksum(kind: str, data: bytes) -> int:
    """Return the checksum of ``data`` by its name in `WIDTHS`; 0 for ``none``."""
    match kind:
        case "crc16_ccitt_false":  # the same numbers, at the speed of C
            return binascii.crc_hqx(data, 0xFFFF)
        case "crc16_xmodem":
            return binascii.crc_hqx(data, 0)
        case "crc32":
            return zlib.crc32(data)
        case "xor8":
            return _xor(data)
        case "lrc8":  # the sum's two's complement, as in Modbus ASCII
            return -sum(data) & 0xFF
        case "fletcher16":  # Fletcher 1982: second sum in the high byte
            return _fletcher(data)
        case _ if kind in CRCS:
            return crc_of(CRCS[kind], data)
    return sum(data) & ((1 << 8 * WIDTHS[kind]) - 1)


def _xor(data: bytes) -> int:
    value = 0
    for byte in data:
        value ^= byte
    return value


def _fletcher(data: bytes) -> int:
    first = second = 0
    for byte in data:
        first = (first + byte) % 255
        second = (second + first) % 255
    return second << 8 | first
