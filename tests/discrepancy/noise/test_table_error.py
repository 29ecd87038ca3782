"""A table's error goes with depth alone: such waves are taken out, and memory is not."""

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.noise import table_error

ERROR = 0.007


def explained(columns, values):
    """Return the share of values that columns explain, both shape (m, ...)."""
    flat = columns.reshape(-1, columns.shape[-1])
    weights = np.linalg.lstsq(flat, values.ravel(), rcond=None)[0]
    return 1 - np.square(values.ravel() - flat @ weights).sum() / np.square(values).sum()


def pressed():
    """Return the rows read, and what stands above the readings without load."""
    reduced = course(episodes=12).reduced
    return reduced, (reduced.readings - np.median(reduced.readings[reduced.tip[:, 2] < 0], axis=0)).astype(float)


def test_a_table_without_a_stated_error_has_no_modes():
    reduced, rise = pressed()
    assert table_error.modes(0.0, rise, np.ones(3), reduced) is None
    assert table_error.common(0.0, rise, reduced).shape == (reduced.rows, 3, 0)


def test_all_modes_together_are_as_large_as_the_error():
    reduced, rise = pressed()
    deep = reduced.tip[:, 2] > 0.1
    level = np.sqrt(np.mean(np.square(rise / 4.0), axis=1))
    own = np.sqrt(np.square(table_error.modes(ERROR, rise, np.full(3, 4.0), reduced)).sum(axis=1))
    assert np.median(own[deep] / level[deep]) == pytest.approx(table_error.REPEATED * ERROR, rel=0.2)
    shared = np.sqrt(np.square(table_error.common(ERROR, rise, reduced)).sum(axis=2))
    assert np.median(shared[deep] / np.abs(rise)[deep]) == pytest.approx(table_error.COMMON * ERROR, rel=0.2)


@pytest.mark.parametrize("wave, least", [(0.5, 0.98), (0.25, 0.9)])
def test_waves_over_depth_are_the_tables(wave, least):
    reduced, rise = pressed()
    off = rise * np.sin(2 * np.pi * reduced.tip[:, 2:] / wave)
    assert explained(table_error.common(ERROR, rise, reduced), off) > least


def test_what_differs_between_loading_and_unloading_is_not():
    reduced, rise = pressed()
    assert explained(table_error.common(ERROR, rise, reduced), rise * np.sign(reduced.speed)[:, None]) < 0.2
