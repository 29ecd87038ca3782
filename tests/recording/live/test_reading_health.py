"""Readings that cannot be, and those that may: told apart within two seconds at any rate."""

import numpy as np
import pytest

from tacdata.recording.live.reading_health import ReadingHealth

LIMITS = (0.0, 65535.0)


def told_after(frames, rate):
    """Return when something is said [s], or None."""
    health = ReadingHealth(LIMITS)
    for index, counts in enumerate(frames):
        if health.take(round(index / rate * 1e9), np.asarray(counts, float)):
            return index / rate
    return None


def live(seconds, rate, step=1.0, noise=5.0, seed=0):
    rng = np.random.default_rng(seed)
    return np.round((9000 + rng.normal(0, noise, (round(seconds * rate), 24))) / step) * step


@pytest.mark.parametrize("rate", [30, 100, 1000])
@pytest.mark.parametrize("what", ["frozen", "high", "low"])
def test_told_within_two_seconds(rate, what):
    before = live(4, rate)
    last = {"frozen": before[-1], "high": np.full(24, 65535.0), "low": np.zeros(24)}[what]
    told = told_after([*before, *[last] * (5 * rate)], rate)
    assert told is not None
    assert 4 < told < 6


@pytest.mark.parametrize("noise", [5.0, 0.5, 0.2])
def test_a_live_board_is_never_accused(noise):
    assert told_after(live(120, 100, noise=noise), 100) is None


def test_coarse_readings_that_rest_by_nature_are_not_called_frozen():
    assert told_after(live(300, 30, step=64.0, noise=12.0, seed=3), 30) is None


def test_a_board_that_never_changed_is_judged_by_the_check_not_here():
    assert told_after([np.full(24, 9000.0)] * 3000, 30) is None


def test_one_channel_at_its_limit_is_no_reason_to_stop():
    frames = live(30, 30)
    frames[100:, 3] = 65535.0
    assert told_after(frames, 30) is None


def slow_after(arrivals, rate, speed=1.0):
    """Return when the board is said to be slow [s], or None."""
    health, rng = ReadingHealth(LIMITS, rate, speed), np.random.default_rng(0)
    for arrival in arrivals:
        if "no longer at" in health.take(round(arrival * 1e9), rng.normal(9000, 5, 24)):
            return arrival
    return None


@pytest.mark.parametrize("rate", [30, 100, 1000])
@pytest.mark.parametrize("share", [0.5, 0.2])
def test_a_rate_that_falls_is_told_within_two_seconds(rate, share):
    arrivals = [*np.arange(0, 4, 1 / rate), *np.arange(4, 9, 1 / (share * rate))]
    told = slow_after(arrivals, rate)
    assert told is not None and 4 < told < 6


@pytest.mark.parametrize("rate", [30, 1000])
def test_a_gap_and_what_it_held_back_is_no_falling_rate(rate):
    times = np.arange(0, 12, 1 / rate)
    held = np.where((times > 4) & (times < 5.5), 5.5, times)
    assert slow_after(held, rate) is None
    lost = times[(times < 4) | (times > 5.5)]
    assert slow_after(lost, rate) is None
    packets = np.ceil(times / 0.016) * 0.016
    assert slow_after(packets, rate) is None


def test_pauses_of_the_computer_do_not_slow_an_emulated_board():
    """A busy computer lets the board run every 50 ms: 0.4 s at eightfold speed, with what was due in between lost."""
    times = np.arange(0, 40, 1 / 30)
    thin = np.concatenate([times[times < 8], np.arange(8, 10, 0.4), times[times > 10]])
    assert slow_after(thin, 30, speed=8.0) is None
    assert 8 < slow_after(thin, 30) < 10
    falling = np.concatenate([times[times < 8], np.arange(8, 40, 1 / 12)])
    assert 8 < slow_after(falling, 30, speed=8.0) < 8 + 2 * 8


def test_a_board_is_held_to_what_it_did_at_first_not_to_its_description():
    assert slow_after(np.arange(0, 20, 1 / 12), 30) is None
