"""The farm from recordings to label files: nothing twice, nothing lost, a failure is never a label."""

import json
from dataclasses import replace

import numpy as np
import pytest
from farm_examples import SENSOR, label_episodes, press_episode

from tacdata.errors import FormatError, SolveError, UsageError
from tacdata.label_farm.labelling import FarmSettings, Labelling
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.labels import read_label


def test_equal_presses_share_one_solve_and_a_second_run_computes_nothing(tmp_path, label_by_workers, solves):
    episodes = [press_episode(tmp_path, k, x=float(k % 2)) for k in range(4)]
    stages = []
    summary = label_by_workers(episodes, progress=lambda *stage: stages.append(stage))
    assert sorted(summary.written) == [0, 1, 2, 3] and not summary.failed
    assert sorted(x for _, x in solves()) == ["0", "1"]
    assert len(summary.seconds) == 2
    assert stages[-1] == ("solve", 2, 2)
    before = {p.name: p.read_bytes() for p in (tmp_path / "labels").glob("*.parquet")}
    again = label_by_workers(episodes)
    assert again.current == [0, 1, 2, 3] and not again.written and len(solves()) == 2
    assert before == {p.name: p.read_bytes() for p in (tmp_path / "labels").glob("*.parquet")}


def test_a_label_follows_the_nominal_path_frame_by_frame(tmp_path, label_all):
    episode = press_episode(tmp_path, 3, x=1.0, depth=1.2)
    label_all([episode])
    label = read_label(tmp_path / "labels" / "episode-000003.parquet")
    depth = np.maximum(episode.tip_at(episode.taxels.sample_ns)[:, 2], 0.0)
    bump = np.exp(-((SENSOR.map.x[:, None] - 1.0) ** 2 + SENSOR.map.y[None] ** 2) / 4.0)
    assert np.array_equal(label.time_ns, episode.taxels.sample_ns)
    np.testing.assert_allclose(label.signed, depth[:, None, None] * bump, atol=1e-6)
    np.testing.assert_allclose(label.force[:, 2], -depth, atol=1e-6)
    assert (label.signed[depth == 0] == 0).all() and (depth == 0).any()
    parents = label.provenance["parents"]
    assert parents["sensor"] == SENSOR.content_hash and len(parents["solution"]) == 64
    assert label.provenance["parameters"]["solver"]["law"] == "bump"


def test_a_fly_over_has_a_zero_map_and_no_solve(tmp_path, label_all, solves):
    summary = label_all([press_episode(tmp_path, 0, depth=-0.4)])
    assert summary.written == [0] and summary.untouched == 1 and not solves()
    assert not read_label(tmp_path / "labels" / "episode-000000.parquet").signed.any()


def test_a_failure_keeps_its_reason_and_is_no_label(tmp_path, label_by_workers, solves, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_FAILS", "1")
    episodes = [press_episode(tmp_path, k, x=float(k)) for k in range(3)]
    summary = label_by_workers(episodes)
    assert sorted(summary.written) == [0, 2]
    assert "no equilibrium at state 3" in summary.failed[1]
    assert not (tmp_path / "labels" / "episode-000001.parquet").exists()
    failure = Failure.read(tmp_path / "labels" / "episode-000001.failure.json")
    assert failure.kind == "solve" and "SolveError" in failure.log
    again = label_by_workers(episodes)
    assert "no equilibrium" in again.failed[1] and len(solves()) == 3
    monkeypatch.delenv("FAST_MODEL_FAILS")
    assert label_by_workers(episodes, redo=True).written == [1]
    assert len(solves()) == 4 and not (tmp_path / "labels" / "episode-000001.failure.json").exists()


def test_a_solution_that_is_not_finite_is_a_failure(tmp_path, label_all, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_NAN", "1")
    summary = label_all([press_episode(tmp_path)])
    assert "finite" in summary.failed[0] and not summary.written
    assert not list((tmp_path / "labels").rglob("*.npz"))


def test_a_recording_that_is_no_vertical_press_is_a_failure_with_words(tmp_path, label_all, solves):
    slide = press_episode(tmp_path, 0)
    slide = replace(slide, tip=slide.tip + np.array([[0, 0, 0], [0, 0, 0], [2, 0, 0], [2, 0, 0]]))
    through = press_episode(tmp_path, 1, depth=3.5)
    summary = label_all([slide, through, press_episode(tmp_path, 2)])
    assert "sideways" in summary.failed[0] and "3.3 mm thick" in summary.failed[1]
    assert summary.written == [2]
    document = json.loads((tmp_path / "labels" / "episode-000001.failure.json").read_text())
    assert document["kind"] == "recording" and document["key"] is None


def test_a_recording_that_cannot_be_read_or_labelled_stops_no_other(tmp_path, solves):
    def unreadable():
        raise FormatError("episode-000000.mcap broke off before its attachments", "a recording", "record again")

    backwards = press_episode(tmp_path, 1)
    times = backwards.taxels.sample_ns.copy()
    times[7] = times[6]
    backwards = replace(backwards, taxels=replace(backwards.taxels, sample_ns=times))
    good = press_episode(tmp_path, 2)
    settings = FarmSettings("fast_model:FastModel", workers=1)
    labelling = Labelling(tmp_path / "labels", Store(tmp_path / "labels" / "store"), settings)
    summary = labelling.run({0: unreadable, 1: lambda: backwards, 2: lambda: good})
    assert summary.written == [2]
    assert "broke off" in summary.failed[0] and "time_ns" in summary.failed[1]


def test_a_model_that_cannot_be_built_is_said_in_words(tmp_path, solves):
    with pytest.raises(UsageError, match="no model"):
        label_episodes(tmp_path / "labels", [press_episode(tmp_path)], factory="fast_model:Missing")
    with pytest.raises(SolveError, match="cannot be built"):
        label_episodes(tmp_path / "labels", [press_episode(tmp_path)], factory="fast_model:path")
