"""Values with errors: intervals, minimum-effect tests, Holm's correction."""

import numpy as np
import pytest

from tacdata.health.estimate import Spread, UncertainValue, holm, mean


def test_holm_gives_the_values_of_the_textbook():
    # Three tests: 3 x 0.01, 2 x 0.03, and no less than the one before.
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert len(holm([])) == 0


def test_an_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(1)
    found = [mean(rng.normal(3.0, 2.0, 5)) for _ in range(2000)]
    covered = np.mean([low <= 3.0 <= high for low, high in (e.interval for e in found)])
    assert covered == pytest.approx(0.95, abs=0.015)


def test_an_interval_of_a_spread_covers_as_often_as_it_says():
    rng = np.random.default_rng(2)
    found = [Spread(float(np.std(rng.normal(0.0, 2.0, 8), ddof=1)), 7.0) for _ in range(2000)]
    covered = np.mean([low <= 2.0 <= high for low, high in (s.interval for s in found)])
    assert covered == pytest.approx(0.95, abs=0.015)


def test_a_change_within_its_tolerance_is_no_change():
    rng = np.random.default_rng(3)
    at_the_limit = [UncertainValue(float(rng.normal(0.05, 0.01)), 0.01, 1e6).p_beyond(0.05) for _ in range(4000)]
    assert np.mean(np.array(at_the_limit) < 0.05) < 0.05
    assert UncertainValue(0.10, 0.01, 50.0).p_beyond(0.05) < 1e-4
    assert UncertainValue(-0.10, 0.01, 50.0).p_beyond(0.05) < 1e-4
    assert UncertainValue(0.02, 0.01, 50.0).p_beyond(0.05) == 1.0


def test_noise_is_louder_by_the_f_test():
    assert Spread(3.0, 500.0).p_louder(Spread(1.0, 500.0), 1.5) < 1e-9
    assert Spread(1.5, 500.0).p_louder(Spread(1.0, 500.0), 1.5) == pytest.approx(0.5, abs=0.01)
