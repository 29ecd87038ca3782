"""Scores: what is scored, what stands beside it, what is written, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.training.inference import checkpoint
from tacdata.training.inference.prediction import read_prediction, write_prediction
from tacdata.training.networks.network import Network
from tacdata.training.reports import report
from tacdata.training.reports.score_sheet import markdown
from tacdata.training.scoring import baselines
from tacdata.training.scoring.evaluate import METRICS
from tacdata.training.scoring.evaluate import evaluate as evaluate_on
from tacdata.training.scoring.published import TABLE_1
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import train


@pytest.fixture(scope="module")
def trained(frames, tmp_path_factory):
    settings = TrainingSettings(arguments={"hidden": 16, "channels": 4}, epochs=1)
    return train(frames, settings, tmp_path_factory.mktemp("training") / "run", device="cpu", threads=1)


def evaluate(trained, frames):
    return evaluate_on(trained, frames, "cpu", threads=1)


class Oracle(Network):
    """Answers with the map of the frame whose number the first channel carries."""

    offsets = (0,)

    def __init__(self, frames, shift=0.0):
        super().__init__(24, frames.sensor.map.shape, {})
        self.answers = torch.tensor(frames.depth) / 3.0 + shift

    def estimate(self, signals):
        return self.answers[signals[:, 0, 0].long()]


def told(frames):
    """Frames whose first channel is the frame's own number."""
    taxels = frames.taxels.copy()
    taxels[:, 0] = np.arange(len(taxels))
    return replace(frames, taxels=taxels)


def test_a_perfect_network_gets_perfect_scores(frames, trained):
    known = told(frames)
    document = evaluate(replace(trained, network=Oracle(known)), known).document
    table = document["contact_frames"]
    assert table["contact_rmse"]["mean"] < 1e-6
    assert table["iou"]["mean"] == 1.0
    assert document["missed_contact"]["count"] == document["false_contact"]["count"] == 0
    assert document["success"]["count"] == document["success"]["of"] > 0
    # Prediction and label are the same maps, so they agree equally with the prescribed contact.
    prediction, label = (document["prescribed"][k]["centre_depth"]["mean"] for k in ("prediction", "label"))
    assert prediction == pytest.approx(label, abs=1e-6)


def test_a_known_offset_is_measured(frames, trained):
    """Every pixel 0.06 mm too deep: below the contact threshold, so that masks grow only at their rim."""
    known = told(frames)
    document = evaluate(replace(trained, network=Oracle(known, shift=0.02)), known).document
    for name in ("pixel_rmse", "contact_rmse", "peak_error"):
        assert document["contact_frames"][name]["median"] == pytest.approx(0.06, abs=1e-4)
    assert document["false_contact"]["count"] == 0
    assert 0.5 < document["contact_frames"]["iou"]["median"] < 1.0


def test_only_the_test_episodes_of_the_own_dataset_count(frames, trained):
    result = evaluate(trained, frames)
    assert tuple(e.span.number for e in result.episodes) == trained.split.test
    assert result.part == "test"
    assert repr(result).startswith("Evaluation of ") and len(repr(result).splitlines()) == 3 + len(
        baselines.ahead(result.document)
    )
    counted = result.document["frames"]
    length = 24
    assert counted["scored"] == length * len(trained.split.test)
    assert sum(row["frames"] for row in result.document["indenters"]) == counted["in_contact"]
    other = evaluate(trained, replace(frames, dataset_hash="e" * 64))
    assert len(other.episodes) == len(frames.episodes)
    assert other.document["split"]["part"] == "other dataset"
    assert other.document["baselines"] == {}


def test_frames_are_told_apart_by_their_depth(frames, trained):
    """Predicted 0.06 mm too deep everywhere: the shallower the contact, the more the region grows."""
    known = told(frames)
    document = evaluate(replace(trained, network=Oracle(known, shift=0.02)), known).document
    rows = document["depths"]
    assert sum(entry["frames"] for entry in rows) == document["frames"]["in_contact"]
    assert [entry["above_mm"] for entry in rows] == sorted(entry["above_mm"] for entry in rows)
    assert rows[-1]["up_to_mm"] is None
    overlap = [entry["metrics"]["iou"]["mean"] for entry in rows]
    assert overlap[0] < overlap[-1] < 1.0
    documents.check(document, "scores", "scores")


def test_invalid_frames_are_not_scored(frames, trained):
    valid = np.ones(len(frames.taxels), dtype=bool)
    first = frames.spans(trained.split.test)[0]
    valid[first.start : first.start + 10] = False
    document = evaluate(trained, replace(frames, valid=valid)).document
    assert document["frames"]["left_out_as_invalid"] == 10
    assert document["frames"]["scored"] == 24 * len(trained.split.test) - 10


def test_presses_without_any_contact_have_no_scores_and_no_error(frames, trained, tmp_path):
    flown_over = replace(frames, depth=np.zeros_like(frames.depth))
    result = evaluate(trained, flown_over)
    document = result.document
    documents.check(document, "scores", "scores")
    assert document["frames"]["in_contact"] == 0
    assert document["contact_frames"]["contact_rmse"]["mean"] is None
    assert document["success"]["of"] == document["missed_contact"]["of"] == 0
    report.write(report.places(tmp_path, tmp_path / "out"), result, flown_over)
    assert "no such case" in (tmp_path / "out/scores.md").read_text()


def test_data_of_another_sensor_is_refused(other_sensor_frames, trained):
    with pytest.raises(FormatError, match=r"trained for sensor tacprint \(skin/thickness 3\.3 against 3\.0\)"):
        evaluate(trained, other_sensor_frames)


def test_the_linear_baseline_finds_a_linear_world(frames, trained):
    """Labels that are a linear mixture of the signals are regressed almost exactly."""
    generator = np.random.default_rng(1)
    taxels = generator.uniform(0, 100, frames.taxels.shape).astype(np.float32)
    mixture = generator.uniform(0, 1e-3, (24, 35 * 26)).astype(np.float32)
    linear = replace(frames, taxels=taxels, depth=(taxels @ mixture).reshape(-1, 35, 26))
    wanted = linear.indices(trained.split.test)
    maps = baselines.predictions(linear, trained.split, wanted)
    error = {name: np.sqrt(np.mean((m - linear.depth[wanted]) ** 2)) for name, m in maps.items()}
    assert error["linear"] < 0.01 * error["mean"]


def test_a_baseline_that_is_ahead_is_named_in_the_first_line(frames, trained):
    result = evaluate(trained, frames)
    document = result.document
    table = {m: {**document["contact_frames"][m], "median": 0.5} for m in METRICS}
    ahead = {**table, "peak_error": {**table["peak_error"], "median": 0.058}, "iou": {**table["iou"], "median": 0.7}}
    losing = {**document, "contact_frames": table, "baselines": {"linear": ahead, "mean": table}}
    assert baselines.ahead(losing) == {"linear": {"peak_error": (0.058, 0.5), "iou": (0.7, 0.5)}}
    first, second = markdown(losing).splitlines()[0], repr(replace(result, document=losing)).splitlines()[1]
    assert "linear in Peak Depth Error (mm) 0.058 for 0.500, IoU 0.700 for 0.500" in first
    assert "linear, without a network, is ahead in peak depth error, iou" in second
    even = {**losing, "baselines": {"linear": table}}
    assert baselines.ahead(even) == {}
    assert markdown(even).startswith("# Scores of network")


def test_the_sheet_names_the_rig_and_the_paper(frames, trained):
    for virtual, words in ((True, "a virtual rig"), (False, "a real rig"), (None, "does not name")):
        document = evaluate(trained, replace(frames, virtual=virtual)).document
        assert words in document["statement"]
    sheet = markdown(document)
    for metric, (_, title, _) in METRICS.items():
        row = next(line for line in sheet.splitlines() if title in line and line.startswith("|"))
        assert f"{TABLE_1[metric]['median']:.3f}" in row
        assert f"{document['contact_frames'][metric]['median']:.3f}" in row


def test_everything_is_written_and_nothing_overwritten(frames, trained, tmp_path):
    result = evaluate(trained, frames)
    (tmp_path / "run").mkdir()
    place = report.places(tmp_path / "run", None)
    report.write(place, result, frames)
    document = documents.read(tmp_path / "run/scores/scores.json", "scores")
    assert document == result.document
    assert (tmp_path / "run/scores/scores.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "run/scores/scores.md").read_text() == markdown(document)
    for episode in result.episodes:
        stored = read_prediction(tmp_path / f"run/predictions/episode-{episode.span.number:06d}.parquet")
        np.testing.assert_array_equal(stored.depth, episode.depth)
        np.testing.assert_array_equal(stored.time_ns, frames.time_ns[episode.span.start : episode.span.stop])
        assert stored.checkpoint == checkpoint.load(trained.path).content_hash
        assert stored.part == "test"
    with pytest.raises(UsageError, match=r"already holds scores\.json"):
        report.write(place, result, frames)
    report.write(report.places(tmp_path / "run", tmp_path / "again"), result, frames)
    assert (tmp_path / "again/predictions").is_dir()


def test_damaged_predictions_are_refused(frames, trained, tmp_path):
    result = evaluate(trained, frames)
    report.write(report.places(tmp_path, tmp_path / "run"), result, frames)
    path = next((tmp_path / "run/predictions").iterdir())
    stored = read_prediction(path)
    with pytest.raises(FormatError, match="one finite map a frame"):
        write_prediction(tmp_path / "x.parquet", replace(stored, depth=stored.depth[:-1]))
    with pytest.raises(FormatError, match="one finite map a frame"):
        write_prediction(tmp_path / "x.parquet", replace(stored, depth=np.full_like(stored.depth, np.nan)))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(FormatError, match="no readable prediction file"):
        read_prediction(path)
    with pytest.raises(UsageError, match="no prediction file"):
        read_prediction(tmp_path / "nothing.parquet")
