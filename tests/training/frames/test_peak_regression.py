"""A map's maximum is corrected where labelled presses show that it errs, and nothing else of the map."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tacdata.training.frames.peak_regression import FEWEST, fit_peaks
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.predictor import predict
from tacdata.training.networks.network import Network
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

FITTED, UNSEEN = tuple(range(8)), (8, 9, 10, 11)


class Flattened(Network):
    """Answers with the label, whose maximum is a power of the true one: deep presses come out too shallow."""

    offsets = (0,)

    def __init__(self, frames, power=0.7):
        super().__init__(24, frames.sensor.map.shape, {})
        self.power, top = power, frames.sensor.map.depth_max
        self.label = torch.from_numpy(frames.depth) / top
        self.readings = torch.from_numpy(frames.taxels)

    def respond(self, signals):
        rows = torch.cdist(signals[:, -1], self.readings).argmin(dim=1)
        label = self.label[rows]
        largest = label.amax(dim=(1, 2), keepdim=True).clamp(min=1e-6)
        return label * (largest / 0.4) ** (self.power - 1.0)

    def estimate(self, signals):
        raise NotImplementedError


def worst_peak(network, frames, episodes):
    chosen = frames.indices(episodes)
    chosen = chosen[frames.depth[chosen].max(axis=(1, 2)) > 0.2]
    maps = predict(network, Windows(frames, network.offsets), chosen, frames.sensor.map.depth_max)
    return float(np.abs(maps.max(axis=(1, 2)) - frames.depth[chosen].max(axis=(1, 2))).max())


@pytest.fixture
def flattened(frames):
    return Flattened(frames)


def test_maxima_of_unseen_presses_are_corrected(frames, flattened):
    before = worst_peak(flattened, frames, UNSEEN)
    assert before > 0.15
    peaks = fit_peaks(flattened, frames, FITTED)
    flattened.set_peak(peaks.mean, peaks.scale, peaks.weight)
    assert worst_peak(flattened, frames, UNSEEN) < 0.2 * before


def test_the_edge_and_idle_frames_stay(frames, flattened):
    peaks = fit_peaks(flattened, frames, FITTED)
    windows, indices = Windows(frames, (0,)), np.arange(len(frames.taxels))
    before = predict(flattened, windows, indices, frames.sensor.map.depth_max)
    flattened.set_peak(peaks.mean, peaks.scale, peaks.weight)
    after = predict(flattened, windows, indices, frames.sensor.map.depth_max)
    largest = before.max(axis=(1, 2), keepdims=True)
    np.testing.assert_array_equal(after[largest[:, 0, 0] < 0.03], before[largest[:, 0, 0] < 0.03])
    shallow = (before < 0.1 * largest) & (largest > 0.03)
    assert np.abs(after - before)[shallow].max() <= 0.05 * 0.1 * largest.max()


def test_few_presses_correct_nothing(frames, flattened):
    assert fit_peaks(flattened, frames, FITTED[: FEWEST - 1]) is None
    untouched = replace(frames, depth=np.zeros_like(frames.depth))
    assert fit_peaks(flattened, untouched, FITTED) is None


def test_the_correction_is_kept_with_the_checkpoint(frames, tmp_path):
    settings = TrainingSettings(network="direct", epochs=1)
    trained = train(frames, settings, tmp_path / "run", device="cpu", threads=1)
    loaded = checkpoint.load(tmp_path / "run")
    assert trained.document["peak"] == loaded.document["peak"]
    windows, chosen = Windows(frames, loaded.network.offsets), frames.indices(trained.split.test)
    maps = [predict(each.network, windows, chosen, 3.0) for each in (trained, loaded)]
    np.testing.assert_array_equal(*maps)
    loaded.network.peak = None
    assert np.abs(predict(loaded.network, windows, chosen, 3.0) - maps[0]).max() > 1e-3
