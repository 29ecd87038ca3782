"""Gains of the virtual skin's channels, which its truth tells, found although the sensor lies elsewhere."""

import numpy as np
import pytest
from unit_examples import SEED, SENSOR, unit, visited

from tacdata.health.comparison import matched
from tacdata.health.gains import fit_gains

NOISE = np.full(24, 5.0)


@pytest.fixture(scope="module")
def truths():
    return visited(unit(SEED), SEED, 0), visited(unit(SEED), SEED, 1)


@pytest.fixture(scope="module")
def fit(monday, tuesday):
    return fit_gains(monday.responses, tuesday.responses, NOISE, SENSOR)


def test_every_gain_is_within_three_percent(fit, truths):
    true = np.array(truths[1].gain) / np.array(truths[0].gain)
    found = np.array([fit.channels[k].value for k in range(24)])
    assert np.abs(found / true - 1).max() < 0.03
    assert fit.common.value == pytest.approx(float(np.median(true)), abs=0.02)


def test_most_intervals_hold_the_true_gain(fit, truths):
    true = np.array(truths[1].gain) / np.array(truths[0].gain)
    own = true / np.median(true)
    bounds = np.array([fit.own[k].interval for k in range(24)])
    assert ((bounds[:, 0] < own) & (own < bounds[:, 1])).mean() > 0.8


def test_the_shift_of_the_registration_is_found(fit, truths):
    # The tip stands elsewhere by what the sensor's origin is off, the other way; its axis z points out of the skin.
    before, after = (np.array(truth.registration.origin) for truth in truths)
    yaw = np.radians(truths[0].registration.yaw)
    x, y, z = after - before
    sideways = [-np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x - np.cos(yaw) * y]
    assert fit.shift["depth"].value == pytest.approx(z, abs=0.006)
    assert [fit.shift["x"].value, fit.shift["y"].value] == pytest.approx(sideways, abs=0.03)


def test_a_visit_beside_itself_has_a_gain_of_one(monday):
    fit = fit_gains(monday.responses, monday.responses, NOISE, SENSOR)
    assert max(abs(e.value - 1) for e in fit.channels.values()) < 1e-6
    assert max(abs(e.value) for e in fit.shift.values()) < 1e-6


def test_two_sites_are_too_few(monday):
    few = [monday.responses[1], monday.responses[2]]
    assert fit_gains(few, few, NOISE, SENSOR) is None


def test_presses_match_by_place_depth_and_speed(monday, tuesday):
    pairs = matched(tuesday, monday)
    assert pairs == [(k, k) for k in range(11)]
