"""Taxel frames read many at once say what protobuf's own reader says of each."""

import numpy as np
import pytest
from google.protobuf.message import DecodeError

from tacdata.recording.files.taxel_arrays import taxel_frames
from tacdata.schemas import tacdata_pb2 as pb

START = 1_760_000_000_000_000_000


def message(k, counts, **fields):
    own = {"arrival_ns": START + 4_000_000 + k, "sample_ns": START + k, "counter": k, "device_ns": -1, **fields}
    return pb.Taxels(counts=counts, **own).SerializeToString()


def expect(data):
    """Hold the arrays against one message after the other."""
    found, frames = taxel_frames(data), [pb.Taxels.FromString(own) for own in data]
    assert found.arrival_ns.tolist() == [f.arrival_ns for f in frames]
    assert found.counter.tolist() == [f.counter for f in frames]
    assert found.device_ns.tolist() == [f.device_ns for f in frames]
    assert found.widths == tuple(sorted({len(f.counts) for f in frames}))
    if len(found.widths) == 1:
        assert np.array_equal(found.counts, [list(f.counts) for f in frames], equal_nan=True)
    return found


def test_counters_of_every_length_and_without_one():
    rng = np.random.default_rng(0)
    numbers = [*range(300), 16_383, 16_384, 2**31, 2**62, -1]
    expect([message(k, rng.normal(9000, 50, 24)) for k in numbers])


@pytest.mark.parametrize("device", [0, 1, 127, 128, 10**15])
def test_device_times(device):
    expect([message(k, np.arange(24.0) + k, device_ns=device + k) for k in range(50)])


def test_readings_that_are_missing_or_none():
    counts = np.full((20, 24), np.nan)
    counts[::2] = 7.0
    expect([message(k, row) for k, row in enumerate(counts)])
    assert expect([]).counts.shape == (0, 0)
    assert expect([message(k, []) for k in range(5)]).counts.shape == (5, 0)


def test_other_writers_lay_fields_out_otherwise():
    """Order of fields, packing and unknown fields are a writer's own choice (protobuf encoding)."""
    whole = message(300, np.arange(24.0))
    parts = {1: whole[:10], 2: whole[10:20], 3: whole[20:23], 4: whole[23:218], 5: whole[218:]}
    assert [parts[k][0] >> 3 for k in parts] == [1, 2, 3, 4, 5]
    turned = b"".join(parts[k] for k in (5, 4, 3, 2, 1))
    unpacked = parts[1] + b"".join(b"\x21" + np.float64(k).tobytes() for k in range(24)) + parts[3] + parts[5]
    twice = parts[4] + whole
    unknown = whole + b"\x78\x05"
    expect([whole, turned, unpacked, unknown, whole])
    assert expect([whole, twice]).widths == (24, 48)


def test_frames_of_two_widths_are_told():
    assert expect([message(1, np.zeros(24)), message(2, np.zeros(16))]).widths == (16, 24)


def test_what_is_no_frame_is_refused():
    with pytest.raises(DecodeError):
        taxel_frames([message(1, np.zeros(24)), b"\x22\xff\x01no frame at all"])
