"""Single impossible readings are taken out; what a press does is not."""

import numpy as np

from tacdata.chain.rows import rows_of
from tacdata.chain.spikes import copies, without_spikes


def stroke(noise, seed=0):
    rng = np.random.default_rng(seed)
    ramp = np.concatenate([np.zeros(20), np.linspace(0, 500, 15), np.linspace(500, 0, 15), np.zeros(20)])
    return ramp[:, None] * [1.0, 0.4, 0.1, 0.02] + noise * rng.normal(size=(70, 4))


def test_a_jump_of_one_reading_is_taken_out_and_nothing_else():
    clean = stroke(1.0)
    broken = clean.copy()
    broken[8, 0] += 60
    broken[60, 2] -= 45
    mended = without_spikes(broken)
    changed = np.argwhere(mended != broken)
    assert changed.tolist() == [[8, 0], [60, 2]]
    assert np.abs(mended - clean).max() < 5


def test_the_tip_of_a_stroke_stays_whatever_the_noise():
    for noise in (0.0, 0.2, 1.0):
        for seed in range(5):
            values = stroke(noise, seed)
            assert np.array_equal(without_spikes(values)[30:40], values[30:40])


def test_missing_readings_stay_missing():
    values = stroke(1.0)
    values[10:14, 1] = np.nan
    assert np.isnan(without_spikes(values)[10:14, 1]).all()


def test_repeated_frames_are_copies_only_where_they_are_rare():
    values = stroke(1.0)
    values[9] = values[8]
    assert np.flatnonzero(copies(values)).tolist() == [9]
    assert not copies(np.repeat(values, 2, axis=0)).any()
    assert not copies(np.round(values[:, :2] * 0)).any()


def test_rows_average_what_is_known():
    time = np.arange(70) / 30
    values = stroke(1.0)
    values[60:, 3] = np.nan
    rows = rows_of(
        time, values, np.array([0, 0.7, 1.2, 1.7, 2.4]), np.array([[0, 0, z] for z in (0, 0, 1, 0, 0)], float)
    )
    read = rows.values[rows.averaged > 0]
    assert np.isfinite(read[:, :3]).all()
    assert np.isnan(read[-1, 3])
    assert np.isfinite(read[0, 3])


def test_a_copied_frame_with_a_spike_and_a_fresh_force_is_left_out():
    time = np.arange(70) / 30
    values = np.column_stack([stroke(1.0), np.random.default_rng(4).normal(size=70)])
    values[20, 1] += 4000.0
    values[21, :-1] = values[20, :-1]
    path = np.array([0, 0.7, 1.2, 1.7, 2.4]), np.array([[0, 0, z] for z in (0, 0, 1, 0, 0)], float)
    rows = rows_of(time, values, *path, channels=values.shape[1] - 1)
    read = rows.averaged > 0
    assert not np.isclose(rows.time[read], time[21]).any()
    assert np.abs(np.diff(rows.values[read, 1])).max() < 2000.0
