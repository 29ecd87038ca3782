"""Finished labels flow into a dataset while others are computed, and the dataset says what it lacks."""

import os

import pytest
from chaos import ROOT, Service, all_finished
from farm_examples import HERE
from gate import Gate
from running.in_process import tacdata
from session_examples import examples, session

from tacdata.dataset import label_states
from tacdata.dataset.reader import read_dataset


def label(folder, *options, **variables):
    path = os.pathsep.join([str(HERE), str(ROOT)])  # of the workers
    return tacdata(*options, "--factory", "fast_model:FastModel", folder=folder, PYTHONPATH=path, **variables)


def states(folder):
    return {entry.recording: entry.state for entry in label_states.states(folder)}


def test_episodes_flow_in_and_the_dataset_says_what_is_failed_or_stale(tmp_path):
    session(tmp_path / "s", 5)
    words = ("label", "s", "--into", "data", "--workers", "1")
    shown = label(tmp_path, *words, FAST_MODEL_FAILS="-5.9")
    assert shown.returncode == 5, shown.stderr
    assert len(read_dataset(tmp_path / "data").episodes) == 4
    found = states(tmp_path / "data")
    assert found == {f"episode-{k:06d}.mcap": "failed" if k == 2 else "complete" for k in range(5)}
    shown = label(tmp_path, "farm", "dataset", "data")
    assert "4 complete, 0 stale, 1 failed, 0 waiting" in shown.stdout and "no equilibrium" in shown.stdout
    shown = label(tmp_path, *words, "--redo")
    assert shown.returncode == 0, shown.stderr
    assert len(read_dataset(tmp_path / "data").episodes) == 5, "what it holds is not added twice"
    assert set(states(tmp_path / "data").values()) == {"complete"}
    shown = label(tmp_path, "farm", "dataset", "data", FAST_MODEL_VERSION="2")
    assert "0 complete, 5 stale" in shown.stdout and "made by model" in shown.stdout
    shown = label(tmp_path, "label", "s", "--into", "s", "--workers", "1")
    assert shown.returncode == 2 and "no dataset" in shown.stderr


def test_labels_without_spreads_are_not_stale(tmp_path):
    """They are of the same model without what the sensor file says of its spreads."""
    assert session(tmp_path / "s", 2) and examples.SENSOR.uncertainty, "else this test says nothing"
    shown = label(tmp_path, "label", "s", "--into", "data", "--workers", "1", "--no-uncertainty")
    assert shown.returncode == 0, shown.stderr
    assert "2 complete, 0 stale" in label(tmp_path, "farm", "dataset", "data").stdout


@pytest.mark.long("label_farm", "tacdata/dataset", reason="a service and its workers are killed and started again")
def test_the_dataset_grows_while_others_are_computed_and_survives_kills(tmp_path):
    names = ["a", "b"]
    for k, name in enumerate(names):
        session(tmp_path / name, 4, first=4 * k)
    gate = Gate(tmp_path / "gate")
    service = Service(tmp_path, workers=2, seconds=0.0, gate=gate).start()
    for name in names:
        service.client().post("/api/submissions", {"session": name, "by": "ann", "dataset": "data"})
    gate.let(3)
    service.wait(lambda state: sum(entry["labelled"] for entry in state["submissions"]) == 3)
    part = read_dataset(tmp_path / "data")
    assert 0 < len(part.episodes) < 8, "it can be read while it grows"
    service.kill()
    gate.open()
    with service:
        service.wait(all_finished)
    whole = read_dataset(tmp_path / "data")
    assert len(whole.episodes) == 8
    counted = [(entry.recording, entry.state) for entry in label_states.states(tmp_path / "data")]
    assert len(counted) == 8 and {state for _, state in counted} == {"complete"}


def test_a_dataset_of_another_model_is_not_mixed(tmp_path):
    session(tmp_path / "s", 2)
    session(tmp_path / "t", 2, first=2)
    assert label(tmp_path, "label", "s", "--into", "data", "--workers", "1").returncode == 0
    shown = label(tmp_path, "label", "t", "--into", "data", "--workers", "1", FAST_MODEL_VERSION="2")
    assert shown.returncode == 2 and "one model version in a dataset" in shown.stderr
    assert len(read_dataset(tmp_path / "data").episodes) == 2
    pytest.importorskip("fastapi")
    with Service(tmp_path, workers=1, seconds=0.0, FAST_MODEL_VERSION="2") as service:
        service.client().post("/api/submissions", {"session": "t", "by": "ann", "dataset": "data"})
        state = service.wait(lambda state: all_finished(state) and state)
        assert state["submissions"][0]["labelled"] == 2, "the labels themselves are fine"
        assert "nothing flows into data" in state["submissions"][0]["reason"]
