"""Channels that are not where the model has them are told of in words."""

import numpy as np

from tacdata.chain import Course, Response, Tool
from tacdata.discrepancy.data.wiring import miswired

CENTERS = np.array([(x, y) for y in (-1.5, 1.5) for x in (-3.0, 0.0, 3.0)])


class Pads(Response):
    """Six pads whose readings fall off with distance."""

    def load(self, pose, tool):
        far = ((pose[:, None, :2] - CENTERS) ** 2).sum(axis=-1)
        return np.maximum(pose[:, 2:3], 0) ** 1.5 * np.exp(-far / 5)

    def force(self, pose, tool):
        return np.maximum(pose[:, 2], 0) ** 1.5

    def signal(self, load):
        return 500 + 100 * load


def pressed(order=None, sign=None):
    """Return presses over every pad, its channels in an order."""
    rng = np.random.default_rng(0)
    episode = np.repeat(np.arange(12), 30)
    xy = CENTERS[np.arange(12) % 6] + rng.normal(0, 0.5, (12, 2))
    depth = np.tile(np.concatenate([np.full(5, -0.2), np.linspace(0, 1, 20), np.full(5, -0.2)]), 12)
    tip = np.column_stack([xy[episode], depth])
    rise = 100 * Pads().load(tip, episode * 0)
    rise = rise * (sign if sign is not None else 1.0)
    readings = 500 + rise[:, order if order is not None else np.arange(6)] + rng.normal(0, 1, (360, 6))
    return Course(
        time=np.arange(360) / 30 + episode,
        episode=episode,
        tip=tip,
        tool=episode * 0,
        readings=readings,
        averaged=np.ones(360),
        session=np.zeros(12, int),
        site=np.arange(12) % 6,
        tools=(Tool("a", "sphere", 2.0),),
        names=tuple(f"press {k}" for k in range(12)),
        centers=CENTERS,
    )


def test_right_channels_are_not_told_of():
    assert miswired(pressed(), Pads()) == []


def test_two_swapped_channels_are_named():
    assert miswired(pressed([0, 4, 2, 3, 1, 5]), Pads()) == ["channels 1 and 4 look swapped: check their wires"]


def test_a_mirrored_array_is_named_as_a_whole():
    (words,) = miswired(pressed([2, 1, 0, 5, 4, 3]), Pads())
    assert "mirrored along x" in words
    (words,) = miswired(pressed([5, 4, 3, 2, 1, 0]), Pads())
    assert "180 degrees" in words


def test_an_inverted_channel_is_named():
    (words,) = miswired(pressed(sign=np.array([1, 1, -1, 1, 1, 1])), Pads())
    assert words.startswith("channel 2 reads the other way round")
