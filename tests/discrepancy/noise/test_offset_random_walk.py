"""Offsets that wander within a press are told, and what they look like is no effect."""

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.noise import offset_random_walk, readings
from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.whitener import Whitener

RATE = 0.05  # noise scales squared a second


def brownian(reduced, rng, rate):
    """Return a Brownian motion of each channel that begins anew with every episode."""
    steps = rng.normal(size=(reduced.rows, 3)) * np.sqrt(rate * np.maximum(reduced.step, 0))[:, None]
    steps[reduced.first] = 0.0
    walk = np.cumsum(steps, axis=0)
    begin = np.flatnonzero(reduced.first)
    return walk - walk[begin][np.cumsum(reduced.first) - 1]


def projected_draws(seed, rate, episodes=60):
    rng = np.random.default_rng(seed)
    reduced = course(seed=seed, episodes=episodes).reduced
    white = rng.normal(size=(reduced.rows, 3)) / np.sqrt(np.minimum(reduced.averaged, 4))[:, None]
    return reduced, white + brownian(reduced, rng, rate)


def test_the_rate_is_told_where_nothing_presses():
    walks = (projected_draws(k, RATE) for k in range(4))
    told = [offset_random_walk.walk_rate(rest, r, np.ones(3), 0.0, r.site) for r, rest in walks]
    assert np.mean(told) == pytest.approx(RATE, rel=0.3)


def test_white_noise_does_not_wander():
    reduced, rest = projected_draws(5, 0.0)
    assert offset_random_walk.walk_rate(rest, reduced, np.ones(3), 0.0, reduced.site) < 0.1 * RATE


def test_modes_add_up_to_a_brownian_motion_about_its_mean():
    rng = np.random.default_rng(2)
    reduced, rest = projected_draws(2, 3.0, 12)
    rate = offset_random_walk.walk_rate(rest, reduced, np.ones(3), 0.0, reduced.site)
    modes = offset_random_walk.modes(rate, reduced, 0.0)
    rows = np.flatnonzero(reduced.episode == 0)
    # Evenly in time: the mean over an episode is one over time, not over rows.
    walk = np.cumsum(rng.normal(size=(4000, 400)) * np.sqrt(rate * np.ptp(reduced.time[rows]) / 400), axis=1)
    walk -= walk.mean(axis=1, keepdims=True)
    at = (reduced.time[rows] - reduced.time[rows[0]]) / np.ptp(reduced.time[rows])
    expected = np.mean(walk**2, axis=0)[np.minimum((at * 400).astype(int), 399)]
    assert np.square(modes[rows]).sum(axis=1) == pytest.approx(expected, rel=0.2, abs=0.05 * expected.max())


@pytest.mark.parametrize("told", [True, False])
def test_what_is_slow_within_a_press_scatters_as_the_noise_says(told):
    """A column that grows while pressed: its scores scatter by what they know, unless the wander is not told."""
    reduced, rest = projected_draws(7, 0.5)
    rate = offset_random_walk.walk_rate(rest, reduced, np.ones(3), 0.0, reduced.site)
    modes = offset_random_walk.modes(rate, reduced, 0.0) if told else None
    none = np.zeros((reduced.rows, 1), dtype=np.int64)[:, 0]
    known, alone = Noise(np.ones(3), 0.0, 1.0, random_walk=modes), np.zeros((reduced.rows, 3, 1))
    whitener = Whitener(reduced, known, none, None, alone)
    begin = reduced.time[np.flatnonzero(reduced.first)][np.cumsum(reduced.first) - 1]
    slow = np.broadcast_to((reduced.time - begin)[:, None, None], (reduced.rows, 3, 1))
    gram = whitener.episode_grams(np.concatenate([rest[:, :, None], slow], axis=2)).gram
    excess = np.mean(gram[:, 1, 0] ** 2 / gram[:, 1, 1])
    assert excess < 1.4 if told else excess > 5


def test_means_of_a_hum_say_more_than_its_rows_let_one_think():
    reduced, rest = projected_draws(8, RATE)
    rest = rest + 2 * np.sin(2 * np.pi * 6.7 * reduced.time)[:, None] / np.minimum(reduced.averaged, 4)[:, None]
    rate = offset_random_walk.walk_rate(rest, reduced, np.full(3, 1.7), 0.0, reduced.site)
    assert 0.25 < rate / (RATE / 1.7**2) < 1.6


def test_noise_that_grows_with_the_load_is_told():
    rng, reduced = np.random.default_rng(9), course(episodes=60).reduced
    rise = np.maximum(reduced.tip[:, 2:], 0) * np.array([1.0, 0.6, 0.3])
    true = 1 + 2 * rise / rise.max()
    rest = rng.normal(size=true.shape) * true
    told = readings.relative_scale(rest, rise, reduced)
    deep = rise > 0.6 * rise.max()
    assert told[deep].mean() == pytest.approx(true[deep].mean(), rel=0.1)
    assert readings.relative_scale(rng.normal(size=true.shape), rise, reduced) is None


def _quiet_until_pressed(reduced, rng):
    rise = np.maximum(reduced.tip[:, 2:], 0) * np.array([1.0, 0.6, 0.3])
    rest = rng.normal(size=rise.shape) * (1 + 2 * rise / rise.max())
    return rise, rest


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("what", ["dead", "gone", "still", "unread when idle"])
def test_streams_that_say_nothing_when_idle_do_not_spoil_what_others_tell(what):
    reduced = course(episodes=60).reduced
    rise, rest = _quiet_until_pressed(reduced, np.random.default_rng(9))
    whole = readings.relative_scale(rest, rise, reduced)
    idle = rise[:, 1] <= readings.LOAD_EDGES[1] * rise.max()
    rest[idle if "idle" in what or what == "still" else slice(None), 1] = 0.0 if what in ("dead", "still") else np.nan
    told = readings.relative_scale(rest, rise, reduced)
    assert np.isfinite(told).all()
    assert told[:, [0, 2]] == pytest.approx(whole[:, [0, 2]], rel=0.1)


@pytest.mark.filterwarnings("error")
def test_readings_that_all_stand_still_when_idle_tell_no_noise_that_grows():
    reduced = course(episodes=60).reduced
    rise, rest = _quiet_until_pressed(reduced, np.random.default_rng(9))
    assert readings.relative_scale(np.where(rise > 0.03 * rise.max(), rest, 0.0), rise, reduced) is None
