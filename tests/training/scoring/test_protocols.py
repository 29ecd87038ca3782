"""The paper's evaluations: which presses count, what is measured, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.training.frames.trials import DEPTH_TRIAL, POSITION_TRIAL, WEARING_TRIAL, trials
from tacdata.training.networks.network import Network
from tacdata.training.reports.protocol_sheet import markdown
from tacdata.training.scoring.protocols import protocols
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train

PURPOSES = [DEPTH_TRIAL] * 4 + [POSITION_TRIAL] * 4 + [WEARING_TRIAL] * 4


class Answers(Network):
    """Answers with the label of the frame whose number the first channel carries, altered."""

    offsets = (0,)

    def __init__(self, frames, change):
        super().__init__(24, frames.sensor.map.shape, {})
        self.maps = torch.tensor(change(frames.depth.clip(0, 3))) / 3.0

    def estimate(self, signals):
        return self.maps[signals[:, 0, 0].long()]


@pytest.fixture(scope="module")
def trained(frames, tmp_path_factory):
    settings = TrainingSettings(arguments={"hidden": 8, "channels": 4}, epochs=1)
    return train(frames, settings, tmp_path_factory.mktemp("protocols") / "run", device="cpu", threads=1)


@pytest.fixture
def trial_frames(frames):
    """Other data than the network was trained on, presses named, worn by two."""
    spans = tuple(replace(e, purpose=PURPOSES[k], specimen=f"wearer {k % 2}") for k, e in enumerate(frames.episodes))
    taxels = frames.taxels.copy()
    taxels[:, 0] = np.arange(len(taxels))
    return replace(frames, episodes=spans, taxels=taxels, dataset_hash="e" * 64)


def test_purposes_choose_the_trials(trial_frames, frames):
    for purpose in (DEPTH_TRIAL, POSITION_TRIAL, WEARING_TRIAL):
        wanted = [k for k, name in enumerate(PURPOSES) if name == purpose]
        assert [t.span.number for t in trials(trial_frames, purpose)] == wanted
    # A dataset that names no purposes: every press counts.
    assert len(trials(frames, DEPTH_TRIAL)) == len(frames.episodes)


def test_a_known_error_of_depth_and_place_is_measured(trial_frames, trained):
    """Predictions one pixel (0.4 mm) further along x and 0.06 mm deeper, wherever they touch."""

    def change(depth):
        moved = np.roll(depth, 1, axis=1)
        return np.where(moved > 0.05, moved + 0.06, moved).astype(np.float32)

    document = protocols(trial_frames, replace(trained, network=Answers(trial_frames, change)))
    documents.check(document, "protocols", "test")
    labels, ours = document["label_position"][1], document["prediction_position"]
    assert labels["threshold_mm"] == ours["threshold_mm"] == 0.4
    assert labels["all"]["count"] == ours["all"]["count"] == 4
    assert 0.3 < ours["not_truncated"]["mean"] < 0.5
    assert labels["not_truncated"]["mean"] < 0.1
    bias = document["prediction_depth_trials"]["bias"] - document["label_depth"]["bias"]
    assert -0.1 < bias < 0.06


def test_truncation_is_decided_by_the_reference(trial_frames, trained):
    everywhere = replace(trained, network=Answers(trial_frames, lambda depth: np.full_like(depth, 1.0)))
    ours = protocols(trial_frames, everywhere)
    labels = [entry["not_truncated"]["count"] for entry in ours["label_position"]]
    assert ours["prediction_position"]["not_truncated"]["count"] == labels[1]
    assert labels[0] <= labels[1] <= labels[2]


def test_participants_are_averaged_first(trial_frames, trained):
    perfect = replace(trained, network=Answers(trial_frames, lambda depth: depth))
    table = protocols(trial_frames, perfect)["wearing"]
    assert [row["participant"] for row in table["participants"]] == ["wearer 0", "wearer 1"]
    assert [row["trials"] for row in table["participants"]] == [2, 2]
    assert table["overall"]["mean"] == 1.0
    silent = replace(trained, network=Answers(trial_frames, np.zeros_like))
    assert protocols(trial_frames, silent)["wearing"]["overall"]["mean"] == 0.0


def test_the_sheet_stands_beside_the_paper(trial_frames, trained):
    sheet = markdown(protocols(trial_frames, trained))
    assert "virtual rig" in sheet
    for printed in (
        "0.110 ± 0.016",
        "0.338 ± 0.227",
        "0.279 ± 0.201",
        "0.265 ± 0.186",
        "0.247 ± 0.159",
        "0.085 ± 0.057",
        "0.250 ± 0.208",
        "0.285 ± 0.240",
        "0.827 to 0.904",
        "0.861 ± 0.022",
    ):
        assert printed in sheet
    labels_only = markdown(protocols(trial_frames))
    assert "0.110 ± 0.016" in labels_only and "0.085" not in labels_only


def test_what_cannot_be_evaluated_is_refused(trial_frames, frames, trained, other_sensor_frames):
    with pytest.raises(UsageError, match="trained on"):
        protocols(frames, trained)
    with pytest.raises(FormatError, match="trained for sensor"):
        protocols(replace(other_sensor_frames, dataset_hash="e" * 64), trained)
    named = replace(trial_frames, episodes=tuple(replace(e, purpose="rates") for e in trial_frames.episodes))
    with pytest.raises(UsageError, match="holds no depth trial"):
        protocols(named)
