"""Columns of the label that a dataset has only where they were asked for."""

from dataclasses import replace

import numpy as np
import press_example as example
import pytest

from tacdata.dataset import read_dataset
from tacdata.dataset.format import features
from tacdata.dataset.pack import pack
from tacdata.errors import UsageError

ASKED = features.asked_for(["uncertainty", "taxel_counts", "interpolation_error", "error_map"])


def knowing(episode):
    """A label that knows its standard deviations and its readings."""
    label = example.label(episode)
    random = np.random.default_rng(episode.number)
    return replace(
        label,
        uncertainty=(0.1 * random.random(label.signed.shape)).astype(np.float16),
        taxel_counts=random.random(label.taxel_force.shape).astype(np.float32),
        interpolation_error=random.random(len(label.time_ns)).astype(np.float32),
    )


def test_what_is_asked_for_is_carried_along_and_nothing_else(tmp_path):
    episodes = [example.episode(k) for k in range(2)]
    pack(episodes, knowing, tmp_path / "plain")
    assert not features.extra_of(read_dataset(tmp_path / "plain", tmp_path / "cache").columns)
    pack(episodes, knowing, tmp_path / "more", extra=ASKED)
    dataset = read_dataset(tmp_path / "more", tmp_path / "cache")
    assert features.extra_of(dataset.columns) and set(features.extra_of(dataset.columns)) == set(ASKED)
    labels = [knowing(episode) for episode in episodes]
    maps = np.concatenate([label.uncertainty for label in labels]).astype(np.float32)
    assert np.array_equal(dataset["tacdata.uncertainty"].reshape(maps.shape), maps)
    errors = np.concatenate([label.error_map for label in labels]).astype(np.float32)
    assert np.array_equal(dataset["tacdata.error_map"].reshape(maps.shape), errors)
    assert np.array_equal(dataset["tacdata.taxel_counts"], np.concatenate([label.taxel_counts for label in labels]))
    assert dataset["tacdata.interpolation_error"].shape == (len(maps),)
    assert dataset.units["tacdata.uncertainty"] == "mm" and dataset.units["tacdata.taxel_counts"] == "counts"


def test_appending_keeps_the_columns(tmp_path):
    pack([example.episode(0)], knowing, tmp_path / "d", extra=ASKED)
    with pytest.raises(UsageError, match="asked for are none"):
        pack([example.episode(1)], knowing, tmp_path / "d", append=True)
    pack([example.episode(1)], knowing, tmp_path / "d", append=True, extra=ASKED)
    dataset = read_dataset(tmp_path / "d", tmp_path / "cache")
    assert len(dataset.episodes) == 2 and dataset["tacdata.uncertainty"].any(axis=1).all()


def test_an_episode_whose_label_does_not_know_it_is_left_out_by_name(tmp_path):
    packed = pack(
        [example.episode(0), example.episode(1)],
        lambda episode: knowing(episode) if episode.number else example.label(episode),
        tmp_path / "d",
        extra=features.asked_for(["uncertainty"]),
    )
    assert packed.episodes == 1
    assert packed.left_out == (("episode-000000.mcap", "its label has no uncertainty"),)


def test_a_column_that_labels_do_not_have_is_refused():
    with pytest.raises(UsageError, match="no column 'colour'") as refusal:
        features.asked_for(["uncertainty", "colour"])
    assert "taxel_capacitance" in refusal.value.allowed
