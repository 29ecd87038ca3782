"""The calibration of a unit's channels: what is planted is found, what presses cannot tell is shrunk or refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from training_frames import build_frames

from tacdata.errors import FormatError, UsageError
from tacdata.sensor import default_sensor
from tacdata.training.frames.channel_calibration import FARTHEST, SPREAD, ChannelCalibration, calibrate, doubts
from tacdata.training.frames.spreading import spreading
from tacdata.training.networks.network import create


def unit(gains, seed=0, episodes=12, exponent=1.5, noise=2.0):
    """Frames of a unit: force = 0.2 N (c / 1000)^1.5 / gain^1.5, so a channel of gain g reads g times as much."""
    frames = build_frames(episodes, seed=seed)
    clean = 1000 * (np.asarray(frames.taxel_force, float) / 0.2) ** (1 / exponent)
    taxels = clean * gains + np.random.default_rng(seed).normal(0, noise, clean.shape)
    return replace(frames, taxels=taxels.astype(np.float32))


def numbers(frames):
    return tuple(span.number for span in frames.episodes)


def test_planted_gains_and_exponent_are_found():
    gains = np.random.default_rng(1).normal(1.0, 0.1, 24)
    frames = unit(gains, episodes=30)
    found = calibrate(frames, numbers(frames))
    assert abs(found.exponent - 1.5) < 0.01
    assert np.abs(found.gain * gains**1.5 / 0.2 - 1).max() < 0.03
    assert found.presses == 30


def test_stated_errors_cover_the_truth():
    """Each press has a scale of its own, so presses disagree: two standard errors hold most gains, three nearly all."""
    inside = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        gains = rng.normal(1.0, 0.08, 24)
        frames = unit(gains, seed)
        scale = np.repeat(rng.normal(1.0, 0.1, 12), 24)[:, None]
        frames = replace(frames, taxels=(frames.taxels * scale).astype(np.float32))
        found = calibrate(frames, numbers(frames))
        true = 0.2 / gains**1.5
        inside.append(np.abs(found.gain - true) / found.gain_error)
    inside = np.array(inside)
    assert 0.75 < (inside < 2).mean() and (inside < 4).mean() > 0.95, ((inside < 2).mean(), (inside < 4).mean())


def test_a_channel_without_a_touch_takes_the_mean():
    gains = np.full(24, 1.0)
    gains[23] = 0.5
    frames = unit(gains, episodes=8)
    force = np.array(frames.taxel_force)
    force[:, 23] = 0.0
    taxels = np.array(frames.taxels)
    taxels[:, 23] = 0.0
    found = calibrate(replace(frames, taxel_force=force, taxels=taxels), numbers(frames))
    assert abs(found.gain[23] / np.median(found.gain) - 1) < 0.05
    assert found.gain_error[23] == pytest.approx(SPREAD * found.gain.mean())


def test_one_press_tells_the_common_gain_alone():
    frames = unit(np.random.default_rng(4).normal(1.0, 0.1, 24), episodes=6)
    found = calibrate(frames, numbers(frames)[:1])
    assert np.ptp(found.gain) < 1e-9 * found.gain.mean()
    assert found.gain_error == pytest.approx(SPREAD * found.gain)


def test_what_presses_cannot_tell_is_said_with_what_to_record():
    frames = unit(np.ones(24), episodes=12)
    chosen = numbers(frames)
    assert doubts(calibrate(frames, chosen), frames, chosen) == []
    few = doubts(calibrate(frames, chosen[:2]), frames, chosen[:2])[0]
    assert "rest on 2 presses" in few and "record 3 presses or more" in few
    force = np.array(frames.taxel_force)
    force[:, [5, 11]] = 0.0
    aside = replace(frames, taxel_force=force)
    [untouched] = doubts(calibrate(frames, chosen), aside, chosen)
    assert "hardly touched: 5, 11;" in untouched and "record presses over them" in untouched
    unsure = replace(calibrate(frames, chosen), exponent_error=0.3)
    [depths] = doubts(unsure, frames, chosen)
    assert "± 0.30" in depths and "several depths" in depths


def test_swapped_channels_are_refused():
    frames = unit(np.ones(24), episodes=20)
    taxels = np.array(frames.taxels)
    taxels[:, [3, 14]] = taxels[:, [14, 3]]
    with pytest.raises(UsageError, match="channel 3 reads what channel 14 should"):
        calibrate(replace(frames, taxels=taxels), numbers(frames))


def test_channels_that_loads_hardly_reach_are_not_called_swapped():
    frames = unit(np.ones(24), episodes=20)
    taxels, force = np.array(frames.taxels), np.array(frames.taxel_force)
    taxels[:, [3, 14]] = taxels[:, [14, 3]]
    force[:, [3, 14]] *= 0.01
    assert calibrate(replace(frames, taxels=taxels, taxel_force=force), numbers(frames)).presses == 20


def test_presses_into_the_air_and_missing_forces_are_refused():
    frames = build_frames()
    with pytest.raises(UsageError, match="none of 12 presses touches"):
        calibrate(replace(frames, taxel_force=np.zeros_like(frames.taxel_force)), numbers(frames))
    flat = replace(frames.sensor, skin=replace(frames.sensor.skin, protrusion_radius=0.0))
    with pytest.raises(UsageError, match="a flat skin: the model knows no force"):
        calibrate(replace(frames, sensor=flat, taxel_force=np.zeros_like(frames.taxel_force)), numbers(frames))
    with pytest.raises(FormatError, match="does not say the forces"):
        calibrate(replace(frames, taxel_force=None), numbers(frames))


def test_the_network_computes_the_same_forces():
    rng = np.random.default_rng(0)
    known = ChannelCalibration(rng.uniform(0.1, 0.3, 24), 1.4, np.zeros(24), 0.0, 3)
    network = create("pattern", default_sensor())
    network.set_calibration(known.gain, known.exponent)
    counts = rng.normal(0, 800, (5, 24))
    found = network.calibrated(torch.tensor(counts, dtype=torch.float32)).numpy()
    np.testing.assert_allclose(found, known.force(counts), rtol=1e-4, atol=1e-7)
    again = ChannelCalibration.from_document(known.document, default_sensor().taxels)
    np.testing.assert_array_equal(again.gain, known.gain)
    assert again.exponent == 1.4
    assert again.mixing is None  # as files before 1.3 say


def test_a_skin_that_spreads_loads_less_far_is_found():
    """Of a unit whose loads are gathered by a variance of 1.2 mm^2, forces are the model's again."""
    taxels = default_sensor().taxels
    frames = unit(np.random.default_rng(2).normal(1.0, 0.05, 24), episodes=16, noise=0.5)
    gathered = np.asarray(frames.taxel_force, float) @ spreading(taxels, -1.2).T
    counts = np.sign(gathered) * 1000 * (np.abs(gathered) / 0.2) ** (1 / 1.5)
    found = calibrate(replace(frames, taxels=counts.astype(np.float32)), numbers(frames))
    plain = calibrate(replace(frames, taxels=counts.astype(np.float32), simulated=True), numbers(frames))
    missed = [np.square(known.force(counts) - frames.taxel_force).sum() for known in (found, plain)]
    assert abs(found.spread - 1.2) < 3 * found.spread_error + 0.2
    assert 0.0 < found.spread_error < 0.5
    assert missed[0] < 0.3 * missed[1]
    network = create("pattern", default_sensor())
    network.set_calibration(found.gain, found.exponent, found.mixing)
    np.testing.assert_allclose(
        network.calibrated(torch.tensor(counts, dtype=torch.float32)).numpy(), found.force(counts), rtol=1e-3, atol=1e-6
    )
    again = ChannelCalibration.from_document(found.document, taxels)
    np.testing.assert_allclose(again.force(counts), found.force(counts))


def test_simulated_presses_spread_as_the_model_does():
    frames = replace(unit(np.ones(24)), simulated=True)
    found = calibrate(frames, numbers(frames))
    assert (found.spread, found.mixing) == (0.0, None)


def test_one_press_does_not_tell_how_far_loads_spread():
    frames = unit(np.ones(24), episodes=6)
    found = calibrate(frames, numbers(frames)[:1])
    assert (found.spread, found.spread_error) == (0.0, FARTHEST)
