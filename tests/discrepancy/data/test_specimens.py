"""Specimens that were pressed at one place are told apart by how stiff they are, and a rate is no specimen."""

import numpy as np
import pytest

from tacdata.chain.rows import rows_of
from tacdata.discrepancy.data.specimens import specimens


def press(stiff, rate=1.0, seed=0, depth=1.5):
    rng = np.random.default_rng(seed)
    at = np.cumsum([0, 0.5, (depth + 0.2) / rate, 1.0, (depth + 0.2) / rate])
    path = np.array([-0.2, -0.2, depth, depth, -0.2])
    time = np.arange(0, at[-1], 0.02)
    load = np.maximum(np.interp(time, at, path), 0) ** 1.4
    values = (50 + 900 * stiff * load * (1 + 0.01 * rng.normal()) + rng.normal(size=len(time)))[:, None]
    return rows_of(time, values, at, np.column_stack([0 * at, 0 * at, path]), 1)


def told(kinds, rates):
    parts = [press(s, r, k) for k, (s, r) in enumerate(zip(kinds, rates, strict=True))]
    return specimens(parts, np.zeros(len(parts), dtype=np.int64), 1)


def test_five_materials_at_one_place_are_five_specimens():
    kinds = np.repeat([1.0, 0.3, 0.6, 2.0, 1.4], 4)
    group, words = told(kinds, [0.5, 2.0] * 10)
    assert np.array_equal(group, np.repeat(np.arange(5), 4))
    assert "fall into 5 specimens" in words[0]


def test_presses_that_read_more_the_faster_they_are_are_of_one_specimen():
    """Peaks that grow by 30 % with each rate are an effect: three rates are no three materials."""
    rates = [0.5, 2.0, 8.0] * 5
    group, words = told([{0.5: 1.0, 2.0: 1.3, 8.0: 1.7}[r] for r in rates], rates)
    assert not group.any() and not words


@pytest.mark.parametrize(("order", "apart"), [([1, 1, 1, 1, 2, 2, 2, 2], False), ([1, 2, 1, 2, 1, 2, 1, 2], True)])
def test_two_that_follow_one_another_are_asked_about(order, apart):
    """A contact that got loose half way looks like a second specimen; in turn it does not."""
    group, words = told([float(s) for s in order], [1.0] * 8)
    assert group.any() == apart
    assert ("if they are two" in words[0]) != apart


def test_one_specimen_that_scatters_stays_one():
    group, words = told(1 + 0.05 * np.random.default_rng(2).normal(size=20), [0.5, 2.0] * 10)
    assert not group.any() and not words
