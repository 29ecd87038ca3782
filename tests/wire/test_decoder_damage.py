"""The decoder on streams that something chewed: no reading is made up, and none that is whole is lost."""

import numpy as np
import pytest

from tacdata.wire import Decoder, Encoder
from tacdata.wire.frames.checksum import checksum
from tacdata.wire.frames.frame_format import from_document
from tacdata.wire.frames.packets import packed, unpacked

MS = 1_000_000
BASE = {"version": "1.1", "name": "t", "counter": "uint32", "channels": {"count": 24, "type": "uint16"}, "rate": 100}
FORMATS = {
    "crc32": {"encoding": "binary", "sync": [0xA5, 0x5A], "checksum": {"kind": "crc32"}},
    "short sync": {"encoding": "binary", "sync": [0], "checksum": {"kind": "crc32c", "covers": "frame"}},
    "modbus order": {
        "encoding": "binary",
        "endianness": "big",
        "sync": [1, 2, 3],
        "trailer": [13, 10],
        "checksum": {"kind": "crc32_mpeg2", "endianness": "little"},
    },
    "slip": {"encoding": "binary", "framing": "slip", "checksum": {"kind": "crc32"}},
    "cobs": {"encoding": "binary", "framing": "cobs", "checksum": {"kind": "crc32"}},
    "ascii": {"encoding": "ascii", "sync": "$C,", "checksum": {"kind": "crc32"}},
    "ascii without sync": {"encoding": "ascii", "separator": " ", "radix": 16, "checksum": {"kind": "crc32"}},
}


def chewed(rng, frames):
    """Return the stream, and the numbers of the frames that nothing touched nor stands right before."""
    stream, whole, touched = b"", [], False
    for number, frame in enumerate(frames):
        fate = rng.integers(12)
        data = bytearray(frame)
        if fate == 0:
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        elif fate == 1:
            del data[int(rng.integers(len(data))) :]
        elif fate == 2:
            del data[: int(rng.integers(1, len(data)))]
        elif fate == 3:
            data = bytearray()
        elif fate == 4:
            data += frame
        elif fate == 5:
            data += rng.integers(0, 256, rng.integers(1, 200), dtype=np.uint8).tobytes()
        hurt = fate in (0, 1, 2, 3)
        if not hurt and not touched:
            whole.append(number)
        touched = hurt or fate == 5
        stream += bytes(data)
    return stream, whole


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("seed", range(4))
def test_what_comes_out_was_sent_and_what_was_whole_comes_out(name, seed):
    rng = np.random.default_rng([seed, *name.encode()])
    layout = from_document({**BASE, **FORMATS[name]}, name)
    encoder = Encoder(layout)
    sent = rng.integers(0, 65536, (150, 24))
    stream, whole = chewed(rng, [encoder.encode(row, 7 + k) for k, row in enumerate(sent)])
    decoder, got, at = Decoder(layout), [], 0
    while at < len(stream):
        step = int(rng.integers(1, 300))
        got += decoder.feed(stream[at : at + step], at * MS)
        at += step
    numbers = [frame.counter - 7 for frame in got]
    assert numbers == sorted(set(numbers)), "in order, none twice"
    for number, frame in zip(numbers, got, strict=True):
        np.testing.assert_array_equal(frame.counts, sent[number])
    assert set(whole[:-1]) <= set(numbers)
    assert len(numbers) < 150
    assert decoder.counts.received == len(got)
    assert decoder.counts.lost == numbers[-1] - numbers[0] + 1 - len(numbers)
    assert decoder.counts.repeated > 0
    assert decoder.counts.corrupt + decoder.counts.garbage_bytes > 0
    assert decoder.counts.garbage_bytes <= len(stream)
    in_one = Decoder(layout).feed(stream, 0)
    assert [f.counter for f in in_one] == [f.counter for f in got], "however the bytes are cut"


@pytest.mark.parametrize("name", FORMATS)
def test_noise_gives_nothing_and_takes_no_memory(name):
    rng = np.random.default_rng(1)
    decoder = Decoder(from_document({**BASE, **FORMATS[name]}, name))
    for k in range(400):
        assert decoder.feed(rng.integers(0, 256, 500, dtype=np.uint8).tobytes(), k) == []
    assert len(decoder._arrivals) < 10
    assert len(decoder._frames.buffer) < 3000


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("crc8_maxim", b"123456789", 0xA1),
        ("crc8_sae_j1850", b"123456789", 0x4B),
        ("crc16_kermit", b"123456789", 0x2189),
        ("crc16_x25", b"123456789", 0x906E),
        ("crc16_arc", b"123456789", 0xBB3D),
        ("crc32_mpeg2", b"123456789", 0x0376E6E7),
        ("crc32c", b"123456789", 0xE3069283),
        ("lrc8", b"123456789", 0x23),
        ("fletcher16", b"abcde", 0xC8F0),
    ],
)
def test_further_checksums_give_the_published_check_values(kind, text, value):
    assert checksum(kind, text) == value


@pytest.mark.parametrize("framing", ["slip", "cobs"])
def test_packets_come_back_whatever_they_hold(framing):
    rng = np.random.default_rng(2)
    end = {"slip": b"\xc0", "cobs": b"\0"}[framing]
    for length in [*range(1, 40), 253, 254, 255, 256, 508, 600]:
        for data in (bytes(length), b"\xff" * length, rng.integers(0, 256, length, dtype=np.uint8).tobytes()):
            packet = packed(framing, data)
            assert packet.endswith(end)
            inside = packet.strip(end) if framing == "slip" else packet[:-1]
            assert end not in inside
            assert unpacked(framing, inside) == data
    assert packed("cobs", b"\x11\x22\x00\x33") == bytes.fromhex("0311220233 00".replace(" ", ""))
    assert packed("slip", b"\xc0\xdb\x01") == bytes.fromhex("c0 dbdc dbdd 01 c0".replace(" ", ""))


def test_a_reading_that_the_board_calls_nan_is_kept_as_it_is():
    for encoding in ({"encoding": "binary", "sync": [9]}, {"encoding": "ascii", "sync": "$"}):
        layout = from_document(
            {**BASE, **encoding, "channels": {"count": 2, "type": "float32"}, "checksum": {"kind": "crc32"}}, "t"
        )
        (frame,) = Decoder(layout).feed(Encoder(layout).encode(np.array([1.5, np.nan]), 3), 0)
        np.testing.assert_array_equal(frame.counts, [1.5, np.nan])


def test_wide_numbers_come_back():
    layout = from_document(
        {
            **BASE,
            "encoding": "binary",
            "sync": [9],
            "timestamp": {"type": "uint64", "tick": 1e-6},
            "channels": {"count": 2, "type": "float64"},
            "checksum": {"kind": "sum16"},
        },
        "t",
    )
    encoder = Encoder(layout)
    frames = Decoder(layout).feed(b"".join(encoder.encode(np.array([0.1, -1e9]), k, 2**40 + k) for k in range(2)), 0)
    assert [f.device_ns for f in frames] == [2**40 * 1000, (2**40 + 1) * 1000]
    assert frames[1].counts.tolist() == [0.1, -1e9]
