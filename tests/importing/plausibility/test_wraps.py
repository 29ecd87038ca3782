"""Numbers that wrap as a counter or without their sign are continued; fast and saturating readings are none."""

import numpy as np
import pytest
from sources import mapping, table, write

from tacdata.importing.imported_session import import_session
from tacdata.importing.plausibility.wraps import unwrapped
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_episode

DEPTH = table(presses=3)[:, 1]
NOISE = np.random.default_rng(1).normal(0, 2, len(DEPTH))


@pytest.mark.parametrize(
    ("bits", "rest", "gain", "shown"),
    [(16, -20, 1000, 0), (24, -400, 9000, 0), (16, -5, 1000, 0), (8, 200, 100, 200), (12, 4000, 300, 4000)],
)
def test_a_wrapped_reading_is_continued_and_told(bits, rest, gain, shown):
    true = np.rint(rest + gain * DEPTH + NOISE)
    values, (words,) = unwrapped((true % 2**bits)[:, None], "taxels", signed=True)
    assert np.array_equal(values[:, 0] - values[0, 0], true - true[0])
    assert abs(values[0, 0] - rest) < 10 and abs(values[0, 0]) >= min(shown, abs(rest)) - 10
    assert f"at 2^{bits}" in words


def test_a_position_keeps_the_turn_of_its_first_rows():
    true = np.rint(65000 + 1000 * DEPTH)
    values, words = unwrapped((true % 2**16)[:, None], "position", signed=False)
    assert np.array_equal(values[:, 0], true) and words


@pytest.mark.parametrize(
    ("name", "readings"),
    [
        ("a fast press to the rail of 10 bits", np.where(DEPTH > 0.6, 1010, 4) + np.rint(NOISE).clip(-3, 3)),
        ("a fast press of 16 bits", np.where(DEPTH > 0.6, 61000.0, 900.0) + np.rint(100 * NOISE)),
        ("a motion over the whole range", np.rint(DEPTH / 1.2 * 255)),
        ("numbers with decimals", (65530.5 + 1000 * DEPTH) % 65536),
    ],
)
def test_a_fast_reading_is_no_wrap(name, readings):
    values, words = unwrapped(readings[:, None], name, signed=True)
    assert not words and np.array_equal(values[:, 0], readings)


@pytest.mark.parametrize("trusted", (False, True))
def test_a_mapping_may_trust_numbers_that_wrap(tmp_path, trusted):
    rows = table(presses=3)
    rows[:, 2] = np.rint(1000 * (rows[:, 2] - 10) - 20) % 65536
    taxels = {"file": "run", "columns": ["c0", "c1"], "trusted": trusted}
    path = mapping(tmp_path, write(tmp_path, "npz", rows), taxels=taxels)
    made = import_session(tmp_path, path, tmp_path / "session")
    (episode,) = [read_episode(file) for file in read_session(made.folder).episodes]
    assert (episode.taxels.counts[:, 0].max() > 60000) == trusted
    assert any("numbers wrap" in note for note in made.notes) != trusted
