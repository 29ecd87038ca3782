"""Taxel frames as arrays: every number of each message, one width for all."""

import numpy as np
import pytest
from google.protobuf.message import DecodeError

from tacdata.recording.files.taxel_arrays import taxel_frames
from tacdata.schemas import tacdata_pb2 as pb

START = 1_760_000_000_000_000_000


def message(k, counts, **fields):
    own = {"arrival_ns": START + 4_000_000 + k, "sample_ns": START + k, "counter": k, "device_ns": -1, **fields}
    return pb.Taxels(counts=counts, **own).SerializeToString()


def test_numbers_of_any_length_come_back():
    counters, counts = [0, 127, 128, 16_384, 2**62, -1], np.random.default_rng(0).normal(9000, 50, (6, 24))
    found = taxel_frames([message(k, row, device_ns=10 * k % 2**62) for k, row in zip(counters, counts, strict=True)])
    assert found.counter.tolist() == counters
    assert found.arrival_ns.tolist() == [START + 4_000_000 + k for k in counters]
    assert found.device_ns.tolist() == [10 * k % 2**62 for k in counters]
    assert np.array_equal(found.counts, counts)
    assert found.widths == (24,)


def test_readings_that_are_missing_or_none():
    counts = np.full((20, 24), np.nan)
    counts[::2] = 7.0
    assert np.array_equal(taxel_frames([message(k, row) for k, row in enumerate(counts)]).counts, counts, True)
    assert taxel_frames([]).counts.shape == (0, 0)
    assert taxel_frames([message(k, []) for k in range(5)]).counts.shape == (5, 0)


def test_frames_of_two_widths_are_told():
    found = taxel_frames([message(1, np.zeros(24)), message(2, np.zeros(16))])
    assert found.widths == (16, 24)
    assert found.counts.shape == (2, 0)


def test_what_is_no_frame_is_refused():
    with pytest.raises(DecodeError):
        taxel_frames([message(1, np.zeros(24)), b"\x22\xff\x01no frame at all"])
