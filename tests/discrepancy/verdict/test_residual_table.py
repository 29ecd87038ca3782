"""The residuals' file: what is written is read back, bounded in size, and damage is said in words."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.sufficiency import shortcomings
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.verdict.before_and_after import beside_model
from tacdata.discrepancy.verdict.residual_table import read, write
from tacdata.discrepancy.verdict.sealed import chosen
from tacdata.errors import FormatError
from tacdata.viewers.parts.residual_curves import residual_curves


@pytest.fixture(scope="module")
def late():
    """Presses whose readings come late, judged up to what fits best; channel 1 of the recordings was left out."""
    own = replace(course(delay=0.05), numbers=(0, 2, 3))
    return own, judge(own, read_spec(None), until="fit").found


def test_residuals_are_read_back_with_the_sealed_episodes(late, tmp_path):
    own, found = late
    sealed = chosen(own)
    write(tmp_path / "residuals.parquet", beside_model(own, found, sealed), "a" * 64)
    table = read(tmp_path / "residuals.parquet")
    assert table.streams == ("channel 0", "channel 2", "channel 3") and table.sealed == tuple(sealed) and len(sealed)
    np.testing.assert_array_equal(table.measured, own.readings[own.read].astype(np.float32))
    there = np.isin(table.episode, sealed)
    left = [np.mean(np.square(table.standardized(predicted)[there])) for predicted in (table.before, table.after)]
    assert left[1] < 0.2 * left[0], "the effect helps in episodes that nobody saw"
    deep = table.depth > 0.99 * table.depth.max()
    assert set(table.phase) == {0, 1, 2, 3} and table.phases[np.bincount(table.phase[deep]).argmax()] == "hold"


def test_the_file_stays_small_and_curves_do_not_run_from_press_to_press(late):
    own, found = late
    table = beside_model(own, found, chosen(own), value_limit=600)
    assert table.measured.size <= 600 and table.every > 1
    curves = {c.name: c for c in residual_curves(table)}
    assert curves["readings/channel_2"].labels == ("measured", "before", "after")
    gaps = np.isnan(curves["readings/channel_2"].values).all(axis=1)
    assert gaps.sum() == own.episodes - 1 and (np.diff(curves["depth"].time_ns) >= 0).all()


def test_a_torn_file_is_named(late, tmp_path):
    own, found = late
    path = tmp_path / "residuals.parquet"
    write(path, beside_model(own, found, chosen(own), value_limit=600), "a" * 64)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(FormatError, match=r"residuals\.parquet"):
        read(path)


def test_a_fast_way_to_the_skin_does_not_hide_the_rates_of_pressing():
    """Every episode comes to the skin at 5 mm/s; presses are of two rates, as many of the one as of the other."""
    own = course(episodes=12, rates=(0.5, 2.0))
    assert not any("one rate only" in words for words in shortcomings(own))
    assert any("one rate only" in words for words in shortcomings(course(episodes=12, rates=(1.0,))))
    near = [words for words in shortcomings(course(episodes=12, rates=(1.0, 1.8))) if "rate" in words]
    assert any("most presses differ in rate by a factor of 1.8 only" in words for words in near)
