"""Mirrored frames are those of the mirrored press; gains vary a channel over the whole window alike."""

import numpy as np
import pytest
import torch

from tacdata.sensor import default_sensor
from tacdata.training.frames.variation import Variation
from tacdata.training.networks.network import create
from tacdata.training.settings import TrainingSettings


def prepared(**settings):
    sensor = default_sensor()
    network = create("direct", sensor, {"hidden": 4})
    network.set_normalization(np.linspace(-5, 5, 24), np.linspace(1, 3, 24))
    return sensor, network, Variation(network, sensor, TrainingSettings(**settings))


def test_a_press_on_a_taxel_moves_with_its_map():
    """Signal on one taxel and depth at the pixel above it, far from the middle: they stay together."""
    sensor, network, varied = prepared(mirror=True)
    centers = sensor.taxels.centers
    column, row = 5, 0
    taxel = column + sensor.taxels.columns * row
    standard = torch.zeros(400, 9, 24)
    standard[:, :, taxel] = 7.0
    signals = standard * network.get_buffer("sd") + network.get_buffer("mean")
    label = torch.zeros(400, 35, 26)
    pixel = [
        int(np.argmin(np.abs(axis - place)))
        for axis, place in zip((sensor.map.x, sensor.map.y), centers[taxel], strict=True)
    ]
    label[:, pixel[0], pixel[1]] = 1.0
    torch.manual_seed(0)
    turned, maps = varied(signals, label)
    lit = ((turned - network.get_buffer("mean")) / network.get_buffer("sd"))[:, 4].argmax(dim=1)
    found = maps.flatten(1).argmax(dim=1)
    place = np.stack([sensor.map.x[found // 26], sensor.map.y[found % 26]], axis=1)
    assert np.abs(place - centers[lit.numpy()]).max() < sensor.map.pixel_pitch
    assert sorted(set(lit.tolist())) == [0, 5, 18, 23]


def test_gains_differ_by_frame_and_channel_and_not_within_a_window():
    _, _, varied = prepared(gain_jitter=0.1)
    torch.manual_seed(0)
    signals, label = varied(torch.ones(500, 9, 24), torch.zeros(500, 35, 26))
    assert torch.equal(signals, signals[:, :1].expand(-1, 9, -1))
    assert float(signals.std()) == pytest.approx(0.1, rel=0.05)
    assert not label.any()


def test_loads_spread_by_a_variance_and_none_is_lost():
    sensor, _, varied = prepared(spread_jitter=0.4)
    signals = torch.zeros(3000, 1, 24)
    signals[:, 0, 8] = 1.0  # amid the grid
    torch.manual_seed(0)
    spread, _ = varied(signals, torch.zeros(3000, 35, 26))
    assert float((spread.sum(dim=2) - 1).abs().max()) < 1e-4
    centers = torch.tensor(sensor.taxels.centers - sensor.taxels.centers[8], dtype=torch.float32)
    grown = (spread[:, 0] * centers[:, 1] ** 2).sum(dim=1)  # along y no border is near enough to matter
    assert float(grown.mean()) == pytest.approx(0.0, abs=0.03)
    assert float(grown.std()) == pytest.approx(0.4, rel=0.1)


def test_without_settings_nothing_changes():
    _, _, varied = prepared()
    signals, label = torch.randn(3, 9, 24), torch.rand(3, 35, 26)
    for given, got in zip((signals, label), varied(signals, label), strict=True):
        assert got is given
