"""Rows of an episode: none invented, none lost, dense where the tip moves fast."""

import numpy as np
import pytest

from tacdata.chain import Course, Tool
from tacdata.chain.rows import rows_of

PATH_TIME = np.array([0.0, 1.0, 1.5, 11.5, 12.0, 13.0])
PATH = np.array([[0, 0, d] for d in (-0.5, -0.5, 1.0, 1.0, -0.5, -0.5)], dtype=float)


def laid_out():
    time = np.arange(0, 13, 1 / 30)
    return time, rows_of(time, np.column_stack([time, 2 * time]), PATH_TIME, PATH)


def test_every_reading_is_in_one_row():
    time, rows = laid_out()
    assert rows.averaged.sum() == len(time)
    read = rows.averaged > 0
    total = (rows.values[read] * rows.averaged[read, None]).sum(axis=0)
    np.testing.assert_allclose(total, [time.sum(), 2 * time.sum()])


def test_rests_are_averaged_and_fast_motion_is_dense():
    _, rows = laid_out()
    moving = (rows.time > 1.0) & (rows.time < 1.5)
    assert np.abs(np.diff(rows.tip[moving, 2])).max() < 0.045
    assert np.all(rows.averaged[moving] <= 1)
    hold = (rows.time > 2.5) & (rows.time < 11.0)
    assert rows.averaged[hold].max() > 5
    assert np.isnan(rows.values[rows.averaged == 0]).all()


def test_no_corner_of_the_path_is_cut():
    """Readings miss them all; after the hold, averaged for seconds, a delay would be seen early."""
    time = np.arange(0.01, 13, 1 / 30)
    rows = rows_of(time, np.column_stack([time, 2 * time]), PATH_TIME, PATH)
    there = np.interp(PATH_TIME[1:-1], rows.time, rows.tip[:, 2])
    np.testing.assert_allclose(there, PATH[1:-1, 2], atol=0.004)


def test_noise_of_a_measured_path_is_no_corner():
    rng, path_time = np.random.default_rng(7), np.arange(0, 13, 0.01)
    path = np.column_stack([0 * path_time, 0 * path_time, np.interp(path_time, PATH_TIME, PATH[:, 2])])
    time = np.arange(0.01, 12.9, 1 / 30)
    plain, noisy = (
        rows_of(time, np.column_stack([time, 2 * time]), path_time, path + noise * rng.normal(size=path.shape))
        for noise in (0.0, 0.004)
    )
    assert np.count_nonzero(noisy.averaged == 0) <= np.count_nonzero(plain.averaged == 0) + 5


def test_slow_motion_read_often_is_averaged_and_fast_motion_is_not():
    path_time, path = np.array([0.0, 5.0, 6.0, 6.2]), np.array([[0, 0, 0.0], [0, 0, 1.0], [0, 0, 1.0], [0, 0, 0.0]])
    time = np.arange(0, 6.2, 0.01)  # 0.2 mm/s down, 5 mm/s up
    depth = np.interp(time, path_time, path[:, 2])
    values = np.column_stack([100 * depth, 50 * depth]) + 1e-3 * np.arange(len(time))[:, None]
    rows = rows_of(time, values, path_time, path)
    read = rows.averaged > 0
    slow, fast = read & (rows.time < 5.0), read & (rows.time > 6.01)
    assert slow.sum() < 0.3 * (time < 5.0).sum() and rows.averaged[slow].max() <= 8
    assert fast.sum() == (time > 6.01).sum()
    assert rows.averaged.sum() == len(time)
    # Averages lie where the tip was on average, so nothing is late.
    want = 100 * rows.tip[slow, 2] + 1e-3 * rows.time[slow] / 0.01
    assert np.abs(rows.values[slow, 0] - want).max() < 0.02
    few = rows_of(time[::4], values[::4], path_time, path)
    assert (few.averaged[few.time < 5.0] <= 1).all()


def test_means_stand_at_their_mean_tip_where_the_path_turns():
    """Readings that are the depth: whatever is averaged, a row's reading is its depth."""
    path_time = np.arange(0, 7, 0.001)
    path = np.column_stack([0 * path_time, 0 * path_time, 1 - np.cos(2 * path_time)])
    time = np.arange(0, 6.9, 0.01)
    depth = np.interp(time, path_time, path[:, 2])
    rows = rows_of(time, np.column_stack([depth, depth]), path_time, path)
    assert rows.averaged.max() > 2
    read = rows.averaged > 0
    np.testing.assert_allclose(rows.values[read, 0], rows.tip[read, 2], atol=1e-12)


@pytest.mark.parametrize("kind", ["commanded", "measured"])
def test_turns_of_a_path_are_no_noise_of_it(kind):
    """A path that goes up and down bends in a tenth of its rows and more; only a measured one is noisy."""
    corners, depths = [0.0, 0.5], [0.0, 1.0]
    for depth in (0.8, 1.0) * 30:
        corners += [corners[-1] + 0.05, corners[-1] + 0.1]
        depths += [depths[-1], depth]
    time = np.unique(np.concatenate([np.arange(0.003, corners[-1], 1 / 50), corners]))
    depth = np.interp(time, corners, depths)
    if kind == "measured":
        depth = depth + np.random.default_rng(2).normal(0, 0.003, len(time))
    rows = len(time)
    course = Course(
        time=time,
        episode=np.zeros(rows, dtype=int),
        tip=np.column_stack([0 * depth, 0 * depth, depth]),
        tool=np.zeros(rows, dtype=int),
        readings=np.zeros((rows, 1)),
        averaged=np.ones(rows),
        session=np.zeros(1, dtype=int),
        site=np.zeros(1, dtype=int),
        tools=(Tool("ball", "sphere", 4.0),),
        names=("one",),
    )
    if kind == "commanded":
        assert course.dither == 0.0
    else:
        assert 0.003 <= course.dither < 0.006, "turns are in it, too"
