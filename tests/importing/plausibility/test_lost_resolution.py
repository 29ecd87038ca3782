"""Times from numbers too short for them get even steps or are refused; times of the future are questioned."""

import time

import numpy as np
import pytest

from tacdata.errors import FormatError
from tacdata.importing.plausibility.resolution import restored
from tacdata.importing.times import future


def ns(seconds):
    return np.rint(np.asarray(seconds, float) * 1e9).astype(np.int64)


@pytest.mark.parametrize(
    ("kind", "first", "rate"), [(np.float32, 200_000.0, 100.0), (np.float16, 50.0, 20.0), (np.float32, 3e6, 8.0)]
)
def test_rows_of_a_short_number_get_even_times(kind, first, rate):
    true = first + np.arange(400) / rate
    stored = true.astype(kind).astype(float)
    times, (words,) = restored(stored, ns(stored), "run.npz: t")
    assert np.abs(np.diff(times) / 1e9 - 1 / rate).max() < 0.02 / rate
    assert "-bit numbers" in words and "even times" in words


def test_unix_times_in_32_bits_are_refused():
    stored = (1_764_416_433 + np.arange(6000) / 20).astype(np.float32).astype(float)
    with pytest.raises(FormatError, match="32-bit numbers, 128 s") as caught:
        restored(stored, ns(stored), "run.npz: t")
    assert "64 bits" in caught.value.remedy


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("milliseconds", 20_000_000 + 50.0 * np.arange(300)),
        ("ticks of 1/128 s", 12 + np.arange(300) / 128),
        ("whole seconds of a coarse clock", 200_000 + np.arange(300) // 20),
        ("seconds with decimals", 200_000.01 + 0.05 * np.arange(300)),
        ("a counter of rows", np.arange(300.0)),
        ("times that vary", 1000 + np.cumsum(np.random.default_rng(0).uniform(0.04, 0.06, 300))),
    ],
)
def test_whole_and_exact_times_stay(name, times):
    even, words = restored(times, ns(times), name)
    assert not words and np.array_equal(even, ns(times))


@pytest.mark.parametrize(("added", "words"), [(2_082_844_800, "LabVIEW counts from 1904"), (9e8, "lie in the future")])
def test_unix_times_of_the_future_are_questioned(added, words):
    now = time.time() - 1000
    assert not future(ns(now + np.arange(10)), "run.csv: t")
    assert words in future(ns(now + added + np.arange(10)), "run.csv: t")[0]
