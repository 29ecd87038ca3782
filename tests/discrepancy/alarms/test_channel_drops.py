"""A channel that drops in several presses is found; what noise, steps, spikes and shared errors do is not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.alarms.channel_drops import drops
from tacdata.discrepancy.alarms.press_gains import press_gains
from tacdata.discrepancy.alarms.randomization import RATE, largest, rarest
from tacdata.discrepancy.model.contexts import contexts
from tacdata.discrepancy.model.fitted_response import FittedResponse

IDLE = 5000.0
MIXED = np.array([[1.0, 0.8, 0.5, 0.3, 0.2, 0.3], [0.2, 0.4, 0.5, 0.6, 0.3, 0.2], [0.3, 0.2, 0.3, 0.5, 0.8, 1.0]])
"""Share of three made-up loads in each of six channels [1]."""


def logs_of(seed: int, presses: int = 48, channels: int = 9) -> np.ndarray:
    """Return logarithms of gains with scatter of each channel's own."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.003, 0.02, channels) * rng.normal(size=(presses, channels))


def gains(made) -> np.ndarray:
    """Return the gains of presses beside a response that was fitted to all of them."""
    rows = made.reduced
    setting = SimpleNamespace(course=made, response=FittedResponse(made), given=[])
    problem = SimpleNamespace(setting=setting, placed=[], null=SimpleNamespace(context=contexts(rows)))
    return press_gains(SimpleNamespace(course=rows, episodes=np.unique(rows.episode), problem=problem))  # ty: ignore[invalid-argument-type]


def pressed(seed: int, change=lambda rise, rows: rise, **world):
    """Return presses of six channels of which the rise was changed."""
    made = course(seed=seed, episodes=40, **world)
    readings = np.full((made.rows, 6), np.nan)
    readings[made.read] = IDLE + change((made.readings[made.read] - IDLE) @ MIXED, made.reduced)
    return replace(made, readings=readings, centers=None)


@pytest.mark.parametrize("seed", range(4))
def test_a_channel_that_drops_by_a_quarter_six_times_is_found_though_the_response_follows(seed):
    dropped = np.random.default_rng(seed).choice(40, 6, replace=False)

    def loose(rise, rows):
        return rise * np.where(np.isin(rows.episode, dropped)[:, None] & (np.arange(6) == 1), 0.75, 1.0)

    channel, presses, change = drops(gains(pressed(seed, loose)))  # ty: ignore[not-iterable]
    assert channel == 1 and presses.tolist() == sorted(dropped)
    assert change == pytest.approx(-0.25, abs=0.03)


def test_ordinary_presses_steps_of_counts_a_spike_and_scatter_of_depth_raise_no_alarm():
    def stepped(rise, rows):
        return 4 * np.round(rise / 4)

    def spiked(rise, rows):
        return rise + 300 * (np.arange(len(rise)) == len(rise) // 2)[:, None] * [1, -1, 0.5, 0, 1, -0.2]

    def shallow(rise, rows):
        return rise * np.exp(0.02 * np.random.default_rng(5).normal(size=40))[rows.episode][:, None]

    same = {"plain": lambda rise, rows: rise, "steps": stepped, "spike": spiked, "depth": shallow}
    raised = [(name, seed) for name, change in same.items() for seed in range(6) if drops(gains(pressed(seed, change)))]
    assert not raised


def test_ordinary_gains_raise_no_alarm():
    assert not any(drops(logs_of(seed)) for seed in range(40))


def test_single_jumps_of_many_channels_are_of_no_channel():
    logs = logs_of(2)
    for press, channel in enumerate([0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1, 2]):
        logs[4 * press, channel] -= 0.35
    assert drops(logs) is None


def test_far_presses_of_either_way_are_no_drop():
    """A noisy channel is off both ways; a loose contact is off one way."""
    logs = logs_of(3)
    logs[[4, 14, 24, 34, 40, 44], 2] += [0.4, -0.4, 0.4, -0.4, 0.4, -0.4]
    assert drops(logs) is None
    logs[[4, 14, 24, 34, 40, 44], 2] = -0.4
    assert drops(logs) is not None


def test_the_rate_of_the_harness_is_that_of_its_statistics_together():
    """Of 400 sets of 20 pure noises none, or hardly one, is beyond a rate of 1 in 1,000."""
    rng = np.random.default_rng(3)
    drawn = sum(largest(np.square(rng.normal(size=(1001, 20)))).p <= RATE for _ in range(400))
    known = sum(rarest(rng.random(20)).p <= RATE for _ in range(400))
    assert drawn <= 3 and known <= 3
