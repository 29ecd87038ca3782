"""`tacdata train` and `tacdata evaluate` on a real dataset folder, as a person would type them."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from tacdata import cli
from tacdata.dataset import DatasetWriter
from tacdata.dataset.format import features
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.indenters import from_document
from tacdata.plans import Press
from tacdata.training.frames.data import read_frames

BALL = {"shape": "sphere", "radius": 2.0}


def write_dataset(root, frames, virtual=True, indenters=(BALL,)):
    """Write frames through the real writer, as presses of each of the indenters in turn."""
    writer = DatasetWriter.create(root, frames.sensor)
    for e in frames.episodes:
        here, n = slice(e.start, e.stop), e.stop - e.start
        indenter = from_document(indenters[e.number % len(indenters)])
        press = Press(indenter, e.depth, e.x, e.y, hold=1.0, index=e.number, indenter_name=f"ball {e.number % 2}")
        record = EpisodeRecord(
            sensor=frames.sensor.content_hash,
            recording=f"{e.number:064x}",
            recording_file="episode.mcap",
            label="b" * 64,
            label_provenance={},
            press=press.document,
            rig="bench",
            virtual=virtual,
            baseline=(0.0,) * 24,
            quality=1.0,
            complete=True,
        )
        columns = {
            features.STATE: frames.taxels[here],
            features.RAW: frames.taxels[here] + 1000,
            features.DEPTH: frames.depth[here],
            features.TIP: frames.tip[here],
            features.FORCE: np.zeros((n, 3), np.float32),
            features.TAXEL_FORCE: frames.taxel_force[here],
            features.LABEL_ERROR: np.zeros(n, np.float32),
            features.TIME: frames.time_ns[here],
            features.PHASE: frames.phase[here],
            features.VALID: frames.valid[here],
        }
        writer.append(columns, record, "press")


@pytest.fixture
def dataset(make_frames, tmp_path, monkeypatch):
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "cache"))
    write_dataset(tmp_path / "dataset", make_frames(episodes=8, length=12))
    return tmp_path / "dataset"


def call(*arguments):
    result = CliRunner().invoke(cli.application(), [str(a) for a in arguments])
    if isinstance(result.exception, TacdataError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_a_dataset_becomes_the_same_frames(make_frames, dataset):
    original, read = make_frames(episodes=8, length=12), read_frames(dataset)
    np.testing.assert_array_equal(read.taxels, original.taxels)
    np.testing.assert_allclose(read.depth, original.depth, atol=1e-6)
    np.testing.assert_array_equal(read.phase, original.phase)
    np.testing.assert_array_equal(read.time_ns, original.time_ns)
    assert [(e.start, e.stop, e.x, e.depth) for e in read.episodes] == [
        (e.start, e.stop, e.x, e.depth) for e in original.episodes
    ]
    assert {e.indenter for e in read.episodes} == {"ball 0", "ball 1"}
    assert {e.shape for e in read.episodes} == {"sphere"}
    assert read.virtual is True


def test_train_then_evaluate(dataset, tmp_path):
    run = tmp_path / "run"
    shown = call("train", dataset, "--out", run, "--epochs", 2, "--threads", 1, "--device", "cpu")
    assert "next: tacdata evaluate" in shown
    assert len((run / "metrics.jsonl").read_text().splitlines()) == 2
    call("train", dataset, "--out", run, "--epochs", 3, "--threads", 1, "--device", "cpu", "--resume")
    assert len((run / "metrics.jsonl").read_text().splitlines()) == 3
    shown = call("evaluate", run, "--device", "cpu", "--threads", 1)
    assert "virtual rig" in shown
    scores = json.loads((run / "scores/scores.json").read_text())
    assert scores["split"]["part"] == "test"
    assert len(list((run / "predictions").iterdir())) == len(scores["split"]["episodes"])


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        (["train", "{dataset}", "--out", "{tmp}/run", "--epochs", 0], UsageError, "epochs = 0"),
        (["train", "{dataset}", "--out", "{tmp}/run", "--network", "papr"], UsageError, "did you mean 'paper'"),
        (["train", "{dataset}", "--out", "{tmp}/run", "--split", "indenter"], UsageError, "leaves no train"),
        (["train", "{tmp}/none", "--out", "{tmp}/run"], UsageError, "no folder"),
        (["train", "{dataset}", "--out", "{dataset}"], UsageError, "already exists"),
        (["evaluate", "{tmp}/none"], UsageError, "no checkpoint"),
        (["evaluate", "{dataset}/meta/info.json"], FormatError, "not a readable checkpoint"),
    ],
)
def test_bad_input_ends_in_words(arguments, kind, words, dataset, tmp_path):
    with pytest.raises(kind, match=words):
        call(*(str(a).format(dataset=dataset, tmp=tmp_path) for a in arguments))
    assert not (tmp_path / "run").exists()
