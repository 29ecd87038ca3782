import numpy as np
import pytest

from tacdata.labels import write_label
from tacdata.viewers.parts import label as room
from tacdata.viewers.parts.label import shown_label
from tacdata.viewers.scene.thinning import evenly, extremes, strongest


@pytest.mark.parametrize(
    "choose", [strongest, lambda v, most: extremes(v[:, None], most), lambda v, n: evenly(len(v), n)]
)
def test_what_is_few_stays_whole(choose):
    assert (choose(np.arange(50.0), 50) == np.arange(50)).all()


def test_the_strongest_row_of_every_stretch_is_kept():
    strength = np.random.default_rng(0).random(10_000)
    rows = strongest(strength, 100)
    assert len(rows) == 100 and (np.diff(rows) > 0).all()
    assert strength[rows].min() == pytest.approx(strength.reshape(100, 100).max(axis=1).min())
    assert strength.argmax() in rows


def test_equal_strength_keeps_one_row_a_stretch():
    assert len(strongest(np.zeros(10_000), 100)) == 100


def test_a_spike_in_any_curve_outlives_thinning():
    values = np.random.default_rng(0).normal(0, 1e-3, (50_000, 24))
    for k in range(24):
        values[1000 + 2000 * k, k] = 5.0
        values[1500 + 2000 * k, k] = -5.0
    kept = values[extremes(values, 2000)]
    assert len(kept) <= 2002
    assert (kept.max(axis=0) == 5.0).all() and (kept.min(axis=0) == -5.0).all()


def test_missing_readings_do_not_hide_the_others():
    values = np.full((9_000, 2), np.nan)
    values[:, 1] = np.sin(np.arange(9_000) / 500)
    rows = extremes(values, 300)
    assert values[rows, 1].max() == np.nanmax(values[:, 1]) and rows[0] == 0 and rows[-1] == 8_999


def test_a_long_label_keeps_the_deepest_map_of_each_stretch(label, tmp_path):
    write_label(tmp_path / "a.parquet", label)
    for batch in (7, 1000):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(room, "BATCH", batch)
            shown = shown_label(tmp_path / "a.parquet", 17)
        depth = label.signed.reshape(len(label.signed), -1).max(axis=1)
        assert np.array_equal(shown.kept, strongest(depth, 17))
        assert np.array_equal(shown.signed, label.signed[shown.kept])
        assert np.array_equal(shown.map_ns, label.time_ns[shown.kept])
        assert len(shown.time_ns) == len(shown.force) == len(label.time_ns)
    assert np.array_equal(shown_label(tmp_path / "a.parquet").signed, label.signed)
