"""The decoder against bytes written by hand, damage and wrapping counters."""

import binascii
import struct

import numpy as np
import pytest

from tacdata.errors import FormatError
from tacdata.wire import Decoder, Encoder, default_format
from tacdata.wire.frames.checksum import checksum
from tacdata.wire.frames.frame_format import from_document

# One frame of cap24 by hand: sync, counter 258, channels 1000..1023 little endian, CRC of what follows sync.
GOLDEN_BODY = bytes.fromhex(
    "0201e803e903ea03eb03ec03ed03ee03ef03f003f103f203f303f403f503f603f703f803f903fa03fb03fc03fd03fe03ff03"
)
GOLDEN = bytes.fromhex("a55a") + GOLDEN_BODY + struct.pack("<H", binascii.crc_hqx(GOLDEN_BODY, 0xFFFF))
MS = 1_000_000


def frame(counter: int, value: int = 500) -> bytes:
    body = struct.pack("<H24H", counter & 0xFFFF, *range(value, value + 24))
    return b"\xa5\x5a" + body + struct.pack("<H", binascii.crc_hqx(body, 0xFFFF))


def inline(**changes):
    document = {
        "version": "1.0",
        "name": "t",
        "encoding": "ascii",
        "sync": "$C,",
        "counter": "uint8",
        "channels": {"count": 3, "type": "uint16"},
        "checksum": {"kind": "xor8"},
        "rate": 100,
    }
    document.update(changes)
    return from_document({k: v for k, v in document.items() if v is not None}, "test")


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("crc8", 0xF4),
        ("crc16_ccitt_false", 0x29B1),
        ("crc16_xmodem", 0x31C3),
        ("crc16_modbus", 0x4B37),
        ("crc32", 0xCBF43926),
        ("xor8", 0x31),
        ("sum8", 0xDD),
        ("sum16", 0x01DD),
        ("none", 0),
    ],
)
def test_checksums_give_the_published_check_values(kind, value):
    assert checksum(kind, b"123456789") == value


def test_golden_frame():
    decoder = Decoder(default_format())
    frames = decoder.feed(GOLDEN, 7)
    assert len(frames) == 1
    assert frames[0].counter == 258
    assert frames[0].arrival_ns == 7
    np.testing.assert_array_equal(frames[0].counts, np.arange(1000, 1024))
    assert Encoder(default_format()).encode(np.arange(1000, 1024), 258) == GOLDEN


def test_byte_by_byte_gives_the_arrival_of_the_last_byte():
    decoder = Decoder(default_format())
    got = [f for i, b in enumerate(GOLDEN * 2) for f in decoder.feed(bytes([b]), i)]
    assert [f.arrival_ns for f in got] == [len(GOLDEN) - 1]  # the second carries the same counter
    assert decoder.counts.repeated == 1
    assert decoder.counts.garbage_bytes == 0


def test_garbage_around_frames_is_skipped_and_counted():
    rng = np.random.default_rng(0)
    decoder, good, garbage, got = Decoder(default_format()), 0, 0, []
    for k in range(200):
        junk = rng.integers(0, 256, rng.integers(0, 90), dtype=np.uint8).tobytes()
        garbage += len(junk)
        good += 1
        got += decoder.feed(junk + frame(k), k * 33 * MS)
    got += decoder.feed(bytes(80), 200 * 33 * MS)
    assert [f.counter for f in got] == list(range(good))
    assert all(np.array_equal(f.counts, np.arange(500, 524)) for f in got)
    assert decoder.counts.lost == 0
    assert decoder.counts.corrupt <= 1  # a sync in the junk just where a frame was due
    assert garbage <= decoder.counts.garbage_bytes <= garbage + 80


def test_random_bytes_alone_give_nothing():
    rng = np.random.default_rng(1)
    decoder = Decoder(default_format())
    assert decoder.feed(rng.integers(0, 256, 100_000, dtype=np.uint8).tobytes(), 0) == []
    assert decoder.counts.garbage_bytes > 99_000


def test_half_frame_costs_only_itself():
    decoder = Decoder(default_format())
    got = decoder.feed(frame(1) + frame(2)[:30] + frame(3) + frame(4), 0)
    assert [f.counter for f in got] == [1, 3, 4]
    assert (decoder.counts.corrupt, decoder.counts.lost, decoder.counts.garbage_bytes) == (1, 1, 0)


def test_every_single_bit_flip_is_refused():
    clean = frame(10)
    for bit in range(8 * len(clean)):
        damaged = bytearray(clean)
        damaged[bit // 8] ^= 1 << bit % 8
        decoder = Decoder(default_format())
        got = decoder.feed(frame(9) + bytes(damaged) + frame(11), 0)
        assert [f.counter for f in got] == [9, 11], bit
        assert decoder.counts.lost == 1
        assert decoder.counts.corrupt + (decoder.counts.garbage_bytes > 0) == 1


def test_counter_wraps_and_gaps_are_counted():
    decoder = Decoder(default_format())
    raw = [65533, 65534, 65535, 0, 1, 5, 5, 4, 6]
    got = [f.counter for k, c in enumerate(raw) for f in decoder.feed(frame(c), k * 33 * MS)]
    assert got == [65533, 65534, 65535, 65536, 65537, 65541, 65542]
    assert (decoder.counts.lost, decoder.counts.repeated) == (3, 2)
    assert decoder.counts.notes == []


def test_restarted_board_is_no_loss():
    decoder = Decoder(default_format())
    got = [f.counter for k, c in enumerate([5000, 5001, 0, 1]) for f in decoder.feed(frame(c), k * 33 * MS)]
    assert got == [5000, 5001, 5002, 5003]
    assert decoder.counts.lost == 0
    assert "restarted" in decoder.counts.notes[0]


def test_backlog_after_a_stall_is_no_restart():
    decoder = Decoder(default_format())
    got = [f.counter for k in range(1000) for f in decoder.feed(frame(k), 5)]
    got += [f.counter for f in decoder.feed(frame(1200), 5)]
    assert got == [*range(1000), 1200]
    assert decoder.counts.lost == 200
    assert decoder.counts.notes == []


def test_without_checksum_a_half_frame_is_not_joined_to_the_next():
    layout = inline(encoding="binary", sync=[0xAA, 0x55], checksum=None, counter="uint16")
    good = [b"\xaa\x55" + struct.pack("<4H", k, 1, 2, 3) for k in range(6)]
    decoder = Decoder(layout)
    got = decoder.feed(good[0] + good[1] + good[2][:6] + good[3] + good[4], 0)
    assert [f.counter for f in got] == [0, 1, 3]  # 4 waits for the sync after it
    assert [f.counter for f in decoder.feed(good[5], 9)] == [4]
    assert decoder.counts.corrupt == 1


def test_ascii_line_by_hand():
    # XOR of "17,100,200,65535" is 0x21 (worked out by hand and by a shell loop).
    decoder = Decoder(inline())
    value = 0
    for byte in b"17,100,200,65535":
        value ^= byte
    line = b"$C,17,100,200,65535*%02X\r\n" % value
    got = decoder.feed(b"noise" + line + b"$C,18,1,2\r\n$C,18,$C,19,1,2,3*00\r\n" + line.replace(b"100", b"101"), 3)
    assert [(f.counter, f.counts.tolist()) for f in got] == [(17, [100.0, 200.0, 65535.0])]
    assert (decoder.counts.corrupt, decoder.counts.garbage_bytes) == (3, 5 + 6)


@pytest.mark.parametrize(
    "line", [b"1,2,3,4,5", b"1,2,3", b"1,2,3,70000", b"1,2,3,-1", b"1,2,,4", b"1,2,3,4_0", b"1,2,3,1e2"]
)
def test_ascii_lines_that_are_no_frames(line):
    decoder = Decoder(inline(sync=None, checksum=None))
    assert decoder.feed(b"0,1,1,1\n" + line + b"\n", 0) == []
    assert decoder.counts.corrupt == 1
    assert len(decoder.feed(b"9,1,2,3\n", 0)) == 1


@pytest.mark.parametrize("kind", ["uint8", "int8", "uint16", "int16", "uint24", "int24", "uint32", "int32", "float32"])
@pytest.mark.parametrize(
    "changes",
    [
        {
            "encoding": "binary",
            "sync": [1, 2, 3],
            "endianness": "big",
            "trailer": [13, 10],
            "checksum": {"kind": "crc32", "covers": "frame"},
            "timestamp": {"type": "uint32", "tick": 1e-6},
            "order": ["timestamp", "channels", "counter"],
        },
        {"encoding": "binary", "sync": [255], "checksum": {"kind": "sum8"}},
        {"sync": "T:", "separator": " ", "checksum": {"kind": "crc16_modbus", "covers": "frame"}},
    ],
)
def test_every_type_comes_back(kind, changes):
    layout = inline(**changes, channels={"count": 5, "type": kind})
    bits = int(kind.strip("uintfloa"))
    high = 2 ** (bits if kind[0] == "u" else bits - 1) - 1
    values = np.array([0, 1, high, high // 2, 7]) if kind != "float32" else np.array([0.5, -1.25, 3e5, 0, 7])
    decoder, encoder = Decoder(layout), Encoder(layout)
    first = decoder.feed(encoder.encode(values, 255, 2**32 - 1000), 0)
    second = decoder.feed(encoder.encode(-values if kind[0] in "if" else values, 256, 2**32 + 1000), 10 * MS)
    np.testing.assert_array_equal(first[0].counts, values)
    np.testing.assert_array_equal(second[0].counts, -values if kind[0] in "if" else values)
    assert (first[0].counter, second[0].counter) == (255, 256)
    if layout.timestamp:
        assert second[0].device_ns - first[0].device_ns == 2_000_000


def test_thousand_frames_a_second_survive_bursts():
    decoder = Decoder(inline(encoding="binary", sync=[9, 9], checksum={"kind": "crc8"}, rate=1000))
    encoder = Encoder(decoder.layout)
    stream = b"".join(encoder.encode(np.array([k, k, k]), k) for k in range(1000))
    got = [f for k in range(0, len(stream), 62) for f in decoder.feed(stream[k : k + 62], k)]
    assert [f.counter for f in got] == list(range(1000))
    assert decoder.counts.lost == decoder.counts.corrupt == decoder.counts.garbage_bytes == 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"channels": {"count": 0, "type": "uint16"}}, "channels/count"),
        ({"checksum": {"kind": "md5"}}, "crc16_modbus"),
        ({"encoding": "binary"}, "list of bytes"),
        ({"order": ["channels"]}, "order names channels"),
        ({"rate": -1}, "Hz"),
    ],
)
def test_bad_formats_are_said(changes, words):
    with pytest.raises(FormatError, match=words):
        inline(**changes)


def test_encoder_refuses_what_the_format_cannot_hold():
    with pytest.raises(FormatError, match="0 to 65535"):
        Encoder(default_format()).encode(np.full(24, 70000.0))
