"""A channel that drops in several presses is found; what noise, spikes and shared errors do is not."""

import numpy as np
import pytest

from tacdata.discrepancy.alarms.channel_drops import drops
from tacdata.discrepancy.alarms.randomization import RATE, largest


def gains_of(seed: int, presses: int = 48, channels: int = 9) -> np.ndarray:
    """Return gains with scatter of each channel's own, and of depth, which all share."""
    rng = np.random.default_rng(seed)
    depth = 1 + 0.02 * rng.normal(size=(presses, 1))
    return depth * (1 + rng.uniform(0.003, 0.02, channels) * rng.normal(size=(presses, channels)))


def test_a_channel_that_drops_by_a_quarter_six_times_is_found():
    gains, dropped = gains_of(0), [4, 11, 19, 27, 33, 40]
    gains[dropped, 3] *= 0.75
    channel, presses, change = drops(gains)  # ty: ignore[not-iterable]
    assert channel == 3
    assert presses.tolist() == dropped
    assert change == pytest.approx(-0.25, abs=0.03)


def test_ordinary_presses_raise_no_alarm():
    assert not any(drops(gains_of(seed)) for seed in range(40))


def test_one_spike_and_presses_that_are_off_in_depth_raise_no_alarm():
    gains = gains_of(1)
    gains[7, 2] = 3.0
    gains[[5, 15, 25, 35]] *= 0.7
    assert drops(gains) is None


def test_single_jumps_of_many_channels_are_of_no_channel():
    gains = gains_of(2)
    for press, channel in enumerate([0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1, 2]):
        gains[4 * press, channel] *= 0.7
    assert drops(gains) is None


def test_the_rate_of_the_harness_is_that_of_its_statistics_together():
    """Of 400 sets of 20 pure noises none, or hardly one, is beyond a rate of 1 in 1,000."""
    rng = np.random.default_rng(3)
    raised = sum(largest(np.square(rng.normal(size=(1001, 20)))).p <= RATE for _ in range(400))
    assert raised <= 3
