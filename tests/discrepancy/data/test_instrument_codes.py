"""An instrument's codes for overload are no readings."""

import numpy as np
import pytest

from tacdata.discrepancy.data.channels import codes


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e6])
def test_overload_codes_are_found_in_any_unit(unit):
    values = unit * (10 + np.random.default_rng(0).normal(size=(400, 2)))
    values[[3, 77], 0], values[200, 1] = 4.44444e49, -9.99999e104
    found = codes(values)
    assert [tuple(at) for at in np.argwhere(found)] == [(3, 0), (77, 0), (200, 1)]


def test_a_large_press_and_a_spike_are_no_codes():
    values = np.zeros((1000, 1))
    values[:, 0] = 1e-3 * np.random.default_rng(0).normal(size=1000)
    values[500:520, 0] = 20.0
    values[40, 0] = 500.0
    assert not codes(values).any()


def test_a_channel_that_never_moves_keeps_its_readings():
    assert not codes(np.full((50, 1), 512.0)).any()
    assert not codes(np.zeros((50, 1))).any()
    assert not codes(np.full((50, 1), np.nan)).any()
