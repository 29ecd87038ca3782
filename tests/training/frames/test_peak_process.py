"""A map's maximum is corrected where labelled presses show that it errs, and nothing else of the map."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tacdata.training.completion import _Press as Press
from tacdata.training.completion import _share
from tacdata.training.frames.peak_process import FEWEST, PeakProcess, contacts, features, fit_process
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.predictor import deviations, predict
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


def fitted(network, frames, presses=FITTED, origin=None):
    return fit_process(contacts(network, frames, presses, origin))


def worst_peak(network, frames, episodes):
    chosen = frames.indices(episodes)
    chosen = chosen[frames.depth[chosen].max(axis=(1, 2)) > 0.2]
    maps = predict(network, Windows(frames, network.offsets), chosen, frames.sensor.map.depth_max)
    return float(np.abs(maps.max(axis=(1, 2)) - frames.depth[chosen].max(axis=(1, 2))).max())


@pytest.fixture
def flattened(frames):
    return Flattened(frames)


@pytest.mark.parametrize("moved", [False, True])
def test_maxima_of_unseen_presses_are_corrected(frames, flattened, moved):
    before = worst_peak(flattened, frames, UNSEEN)
    assert before > 0.15
    # With the network before the fit, the correction is the same whatever the fit made of the network's maxima.
    network = Flattened(frames, power=0.6) if moved else flattened
    network.peak = fitted(network, frames, origin=flattened if moved else None)
    assert worst_peak(network, frames, UNSEEN) < 0.2 * before


def test_the_edge_and_idle_frames_stay(frames, flattened):
    windows, indices = Windows(frames, (0,)), np.arange(len(frames.taxels))
    before = predict(flattened, windows, indices, frames.sensor.map.depth_max)
    flattened.peak = fitted(flattened, frames)
    after = predict(flattened, windows, indices, frames.sensor.map.depth_max)
    largest = before.max(axis=(1, 2), keepdims=True)
    np.testing.assert_array_equal(after[largest[:, 0, 0] < 0.03], before[largest[:, 0, 0] < 0.03])
    shallow = (before < 0.1 * largest) & (largest > 0.03)
    assert np.abs(after - before)[shallow].max() <= 0.05 * 0.1 * largest.max()


def test_few_presses_correct_nothing(frames, flattened):
    assert fitted(flattened, frames, FITTED[: FEWEST - 1]) is None
    untouched = replace(frames, depth=np.zeros_like(frames.depth))
    assert fitted(flattened, untouched) is None


def test_the_deviation_grows_away_from_the_presses(frames, flattened):
    deepest = np.array([frames.depth[frames.indices((press,))].max() for press in range(12)])
    shallow = tuple(np.argsort(deepest)[:8].tolist())
    known = contacts(flattened, frames, shallow)
    process, windows = fit_process(known), Windows(frames, (0,))

    def deviation(process, presses):
        touching = frames.indices(presses)
        touching = touching[frames.depth[touching].max(axis=(1, 2)) > 0.2]
        return float(np.median(process.answers(flattened, windows, touching)[1]))

    for press in shallow[:3]:
        assert deviation(fit_process(known.without((press,)), process.kernel), (press,)) > deviation(process, (press,))


def test_presses_left_out_choose_the_share():
    label = np.full((5, 3, 3), 1.0)

    def press(network, process):
        return Press(np.full((5, 3, 3), network), label, np.full(5, process), np.ones(5), 3.0)

    assert _share([press(0.5, 1.0)]) == 1.0
    assert _share([press(1.0, 0.5)]) == 0.0
    assert _share([press(0.5, 2.0)]) == 0.5
    # Four presses that contradict each other choose nothing; four that agree do.
    assert _share([press(1.0, 1.3), press(1.0, 1.2), press(1.0, 1.2), press(0.5, 1.0)]) == 0.75
    assert _share([press(1.0, 1.3), press(1.0, 1.2), press(1.0, 1.2), press(1.0, 1.3)]) == 0.0
    # Many are believed as they are.
    assert _share(3 * [press(1.0, 1.3), press(1.0, 1.2), press(1.0, 1.2), press(0.5, 1.0)]) != 0.75


def test_the_correction_is_kept_with_the_checkpoint(frames, tmp_path):
    settings = TrainingSettings(network="direct", epochs=1)
    first = train(frames, settings, tmp_path / "first", device="cpu", threads=1)
    assert first.network.peak.origin is None
    other = replace(frames, dataset_hash="another")
    trained = train(other, settings, tmp_path / "run", device="cpu", threads=1, pretrained=first)
    loaded = checkpoint.load(tmp_path / "run")
    windows, chosen = Windows(frames, loaded.network.offsets), frames.indices(trained.split.test)
    for function in (lambda network: predict(network, windows, chosen, 3.0), lambda n: deviations(n, windows, chosen)):
        np.testing.assert_array_equal(function(trained.network), function(loaded.network))
    process = loaded.network.peak
    for name, weight in first.network.state_dict().items():
        np.testing.assert_array_equal(process.origin.state_dict()[name], weight)
    maps = predict(replace_share(loaded.network, process, 1.0), windows, chosen, 3.0)
    loaded.network.peak = None
    assert np.abs(predict(loaded.network, windows, chosen, 3.0) - maps).max() > 1e-3


def replace_share(network, process, share):
    network.peak = replace(process, share=share)
    return network


def test_the_correction_moves_with_the_weights(frames, flattened):
    flattened.peak = fitted(flattened, frames, origin=Flattened(frames))
    flattened.double()
    process = flattened.peak
    assert {process.rows.dtype, process.centers.dtype, process.origin.get_buffer("mean").dtype} == {torch.float64}


def test_a_linear_correction_of_an_earlier_release_is_still_applied(frames, flattened):
    document = {"mean": [0.0] * 11, "scale": [1.0] * 11, "weight": [0.1, 0.2] + [0.0] * 10}
    process = PeakProcess.from_document(document, {}, frames.sensor.taxels.centers, None, "cpu")
    signals = torch.from_numpy(frames.taxels[frames.depth.max(axis=(1, 2)) > 0.2][:5])[:, None]
    depth = flattened.respond(signals)
    _, largest = features(depth, signals, flattened, process.centers)
    # The first feature is the logarithm of the maximum, taken up to three deviations.
    expected = largest * torch.exp(0.1 + 0.2 * largest.log().clamp(-3.0, 3.0))
    torch.testing.assert_close(process.corrected(depth, signals, flattened).amax(dim=(1, 2)), expected)
