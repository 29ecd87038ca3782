"""Every network: sizes follow from the sensor, gradients reach every weight, the paper's is the paper's."""

from dataclasses import replace

import pytest
import torch

from tacdata import registry
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import default_sensor
from tacdata.training.networks.network import BASE, ROOM, create

NETWORKS = registry.names(ROOM, BASE)


def other_sensor():
    sensor = default_sensor()
    return replace(
        sensor, taxels=replace(sensor.taxels, columns=5, rows=3), map=replace(sensor.map, pixels_x=18, pixels_y=41)
    )


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("sensor", [default_sensor(), other_sensor()], ids=["tacprint", "other"])
def test_sizes_follow_from_the_sensor(name, sensor):
    network = create(name, sensor)
    maps = network(torch.zeros(2, len(network.offsets), sensor.taxels.count))
    assert maps.shape == (2, *sensor.map.shape)
    again = create(name, sensor, network.arguments)
    assert [p.shape for p in again.parameters()] == [p.shape for p in network.parameters()]


@pytest.mark.parametrize("name", NETWORKS)
def test_every_weight_takes_part(name):
    torch.manual_seed(0)
    network = create(name, default_sensor())
    network(torch.randn(4, len(network.offsets), 24)).square().mean().backward()
    idle = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0]
    assert not idle


@pytest.mark.parametrize("name", NETWORKS)
def test_frames_of_a_batch_do_not_touch_each_other(name):
    torch.manual_seed(0)
    network = create(name, default_sensor()).eval()
    windows = torch.randn(3, len(network.offsets), 24)
    torch.testing.assert_close(network(windows)[1:2], network(windows[1:2]), atol=1e-6, rtol=1e-5)


def test_the_network_of_the_paper():
    network = create("paper", default_sensor())
    shapes = {n: tuple(p.shape) for n, p in network.named_parameters()}
    assert network.offsets == tuple(range(-4, 5))
    # One LSTM layer, one direction: four gates of 256 over 24 inputs and 256 states.
    assert shapes["encoder.weight_ih_l0"] == (4 * 256, 24)
    assert shapes["encoder.weight_hh_l0"] == (4 * 256, 256)
    assert not [n for n in shapes if n.startswith("encoder") and ("l1" in n or "reverse" in n)]
    assert shapes["projection.weight"] == (32 * 9 * 7, 256)
    assert sum(isinstance(m, torch.nn.ConvTranspose2d) for m in network.decoder) == 2
    assert network(torch.zeros(1, 9, 24)).shape == (1, 35, 26)


def test_signals_are_standardized():
    network = create("paper", default_sensor(), {"hidden": 4, "channels": 2}).eval()
    windows = torch.randn(2, 9, 24)
    plain = network(windows)
    network.set_normalization(torch.full((24,), 100.0).numpy(), torch.full((24,), 7.0).numpy())
    torch.testing.assert_close(network(windows * 7 + 100), plain, atol=1e-5, rtol=1e-4)


def test_unknown_names_and_arguments_are_refused():
    with pytest.raises(UsageError, match="did you mean 'paper'"):
        create("papers", default_sensor())
    with pytest.raises(FormatError, match="layers"):
        create("paper", default_sensor(), {"layers": 3})


def test_a_dent_lies_where_the_readings_are():
    sensor = other_sensor()
    network = create("dent", sensor)
    with torch.no_grad():
        network.depths.weight.zero_()
        network.depths.bias.fill_(1.0)
    places = torch.tensor(network.arguments["places"])
    readings = torch.zeros(4, len(network.offsets), 15)
    readings[0, :, 7] = readings[1, :, 3] = readings[2, :, 6] = readings[2, :, 7] = -50.0
    maps = network(readings)
    assert maps[3].abs().max() == 0.0
    for number, expected in ((0, places[7]), (1, places[3]), (2, (places[6] + places[7]) / 2)):
        pixel = torch.tensor(divmod(int(maps[number].argmax()), sensor.map.pixels_y))
        # The outermost taxels of this grid lie outside of its map.
        inside = torch.minimum(expected.clamp(min=0.0), torch.tensor(sensor.map.shape) - 1.0)
        assert (pixel - inside).abs().max() <= 1.0
