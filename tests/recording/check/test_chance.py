"""What noise alone may leave in a recording is no fault."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.recording.check.channel_health import held_by_chance, jumps
from tacdata.recording.check.session import _drifts
from tacdata.recording.episode import PHASES


def noise(sigma, common=0.0, frames=300):
    rng = np.random.default_rng(1)
    return np.round(9000 + rng.normal(0, sigma, (frames, 24)) + common * rng.normal(0, 1, (frames, 1)))


def test_two_equal_frames_of_24_noisy_channels_are_no_chance():
    assert held_by_chance(noise(5.0), noise(5.0)[:60], 2) < 1e-9


def test_noise_that_all_channels_share_or_below_the_resolution_leaves_equal_frames():
    for quiet in (noise(0.0, common=3.0), noise(0.35)):
        equal = (quiet[1:] == quiet[:-1]).all(axis=1)
        assert equal.sum() > 0 or held_by_chance(quiet, quiet[:60], 2) > 0.01
        assert held_by_chance(quiet, quiet[:60], 2) > 0.01


def test_a_board_that_sends_each_reading_twice_is_not_accused():
    twice = np.repeat(noise(5.0), 2, axis=0)
    assert held_by_chance(twice, twice[:60], 2) == np.inf


def held(rng, answers, step=0.0):
    """Return a hold of 24 frames in which channel 0, which answers most, jumps by a step half way [counts]."""
    counts = np.round(9000 + answers + rng.normal(0, 5.0, (24, len(answers))))
    counts[12:, 0] += step
    phase = np.full(24, PHASES.index("hold"))
    taxels = SimpleNamespace(counts=counts, sample_ns=np.arange(24) * 33_333_333)
    return SimpleNamespace(taxels=taxels, phase_at=lambda times: phase)


def test_the_noise_of_channels_of_small_answer_is_no_jump_of_a_large_one():
    rng, answers = np.random.default_rng(3), np.array([1500.0, 700.0, *(105.0,) * 6, 5.0])
    quiet = [jumps(held(rng, answers), np.full(9, 5.0), answers) for _ in range(300)]
    assert sum(map(bool, quiet)) == 0
    (jump,) = jumps(held(rng, answers, step=120.0), np.full(9, 5.0), answers)
    assert jump.channel == 0
    assert jump.size == pytest.approx(120, abs=25)


def recorded(name, drift, rate, seconds, lean=0.0):
    """Return what the check keeps of a recording whose board's clock is off [ppm]; its latencies lean [ppm]."""
    sample_ns = np.arange(0, round(seconds * 1e9), round(1e9 / rate))
    half = np.random.default_rng(2).uniform(0, 5, len(sample_ns) // 2)
    lag = np.concatenate([half, half[::-1]]) + lean * 1e-6 * sample_ns / 1e6
    clock = {"steady": True, "drift": drift, "drift_uncertainty": 88.0}
    episode = SimpleNamespace(taxels=SimpleNamespace(sample_ns=sample_ns), path=SimpleNamespace(name=name))
    return SimpleNamespace(document={"taxels": {"clock": clock}}, lag=lag, recording=SimpleNamespace(episode=episode))


@pytest.mark.parametrize(("rate", "accused"), [(10.0, False), (100.0, True)])
def test_a_drift_is_only_named_where_there_are_frames_enough_to_tell(rate, accused):
    usual = [recorded(f"episode-{k}", 0.0, rate, 5.2) for k in range(5)]
    found = _drifts([*usual, recorded("odd", 320.0, rate, 5.2)])
    assert [finding.file for finding in found] == (["odd"] if accused else [])


def test_early_frames_that_lead_the_line_astray_are_no_drift():
    usual = [recorded(f"episode-{k}", 0.0, 100.0, 5.2) for k in range(5)]
    assert _drifts([*usual, recorded("odd", 320.0, 100.0, 5.2, lean=-320.0)]) == []
