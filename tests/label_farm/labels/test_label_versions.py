"""What changes between two runs: damage, another model version, another sensor, another recording."""

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from farm_examples import SENSOR, press_episode

from tacdata.errors import UsageError
from tacdata.labels import read_label, table


@pytest.mark.parametrize("damage", ["flip", "cut", "empty"])
def test_a_damaged_result_is_made_again(tmp_path, label_all, solves, damage):
    episode = press_episode(tmp_path)
    label_all([episode])
    (result,) = (tmp_path / "labels" / "store").rglob("*.npz")
    intact, label = result.read_bytes(), tmp_path / "labels" / "episode-000000.parquet"
    surface = read_label(label).signed
    data = bytearray(intact)
    data[len(data) // 2] ^= 0xFF
    result.write_bytes({"flip": bytes(data), "cut": intact[: len(intact) // 2], "empty": b""}[damage])
    label.unlink()
    assert label_all([episode]).written == [0]
    assert len(solves()) == 2 and result.with_suffix(".damaged").exists()
    assert np.array_equal(read_label(label).signed, surface)


def test_labels_of_another_model_version_are_not_touched_unless_asked(tmp_path, label_all, solves, monkeypatch):
    episode = press_episode(tmp_path)
    label_all([episode])
    label = tmp_path / "labels" / "episode-000000.parquet"
    old = label.read_bytes()
    monkeypatch.setenv("FAST_MODEL_VERSION", "2")
    with pytest.raises(UsageError, match="a label store from another model version") as refusal:
        label_all([episode])
    assert "--redo" in refusal.value.remedy
    assert label.read_bytes() == old and len(solves()) == 1
    assert label_all([episode], redo=True).written == [0]
    assert label.read_bytes() != old and len(solves()) == 2
    monkeypatch.setenv("FAST_MODEL_VERSION", "1")
    assert label_all([episode], redo=True).found == 1, "results of both versions lie side by side"
    assert len(solves()) == 2


@pytest.mark.parametrize(("adhesion", "named"), [(None, True), ({"law": "exponential"}, False)])
def test_old_labels_whose_skin_passed_through_the_indenter_are_named(tmp_path, label_all, monkeypatch, adhesion, named):
    """The force pulls on the way up, though nothing sticks."""
    episodes = [press_episode(tmp_path, k, x=float(k)) for k in range(3)]
    label_all(episodes)
    path = tmp_path / "labels" / "episode-000001.parquet"
    label, force = read_label(path), np.zeros_like(read_label(path).force)
    force[:, 2] = np.where(np.arange(len(force)) < 20, 0.5, -0.1)
    label.provenance["parameters"]["solver"].setdefault("parameters", {})["adhesion"] = adhesion
    table.write(path, replace(label, force=force))
    monkeypatch.setenv("FAST_MODEL_VERSION", "2")
    with pytest.raises(UsageError) as refusal:
        label_all(episodes)
    assert ("in 1 the skin passed through the indenter" in refusal.value.given) == named
    assert "--redo" in refusal.value.remedy


def test_labels_say_what_the_spreads_make_of_them_unless_told_not_to(tmp_path, label_all, solves):
    episodes = [press_episode(tmp_path, 0), press_episode(tmp_path, 1, depth=-0.4)]
    one = replace(SENSOR, uncertainty={"thickness": 0.2})
    summary = label_all(episodes, sensor=one)
    label = read_label(tmp_path / "labels" / "episode-000000.parquet")
    np.testing.assert_allclose(label.uncertainty, 0.1 * label.signed, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(label.force_uncertainty, 0.1 * np.abs(label.force), rtol=1e-5, atol=1e-9)
    assert [margin.uncertainty for margin in summary.margins] == [pytest.approx(0.05, abs=0.03)]
    apart = read_label(tmp_path / "labels" / "episode-000001.parquet")
    assert apart.uncertainty.shape == apart.signed.shape and not apart.uncertainty.any()
    with pytest.raises(UsageError, match="from another model version"):
        label_all(episodes, sensor=replace(one, uncertainty={"thickness": 0.1}))
    assert label_all(episodes, sensor=one, uncertainty=False, redo=True).written == [1, 0]
    plain = read_label(tmp_path / "labels" / "episode-000000.parquet")
    assert plain.uncertainty is None and np.array_equal(plain.signed, label.signed)
    assert label_all(episodes, sensor=one, redo=True).found == 1 and len(solves()) == 2


def test_other_transduction_changes_the_readings_without_a_solve(tmp_path, label_all, solves):
    episode = press_episode(tmp_path)
    label_all([episode])
    path = tmp_path / "labels" / "episode-000000.parquet"
    before = read_label(path)
    louder = replace(SENSOR, transduction=replace(SENSOR.transduction, gain=(20_000.0,)))
    assert label_all([episode], sensor=louder).written == [0] and len(solves()) == 1
    after = read_label(path)
    rest = SENSOR.transduction.offset[0]
    np.testing.assert_allclose(after.taxel_counts - rest, 2 * (before.taxel_counts - rest), rtol=1e-3, atol=1e-2)
    assert np.array_equal(after.signed, before.signed)


def test_a_label_of_an_older_format_is_not_replaced_unasked(tmp_path, label_all):
    episode = press_episode(tmp_path)
    label_all([episode])
    path = tmp_path / "labels" / "episode-000000.parquet"
    content = pq.read_table(path)
    header = json.loads(content.schema.metadata[table.HEADER])
    older = {table.HEADER: json.dumps({**header, "version": "1.0"})}
    pq.write_table(content.drop_columns(["error_map"]).replace_schema_metadata(older), path)
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"are of label format version 1\.0"):
        label_all([episode])
    assert path.read_bytes() == before
    assert label_all([episode], redo=True).written == [0]
    assert read_label(path).error_map.dtype == np.float16


def test_a_new_recording_of_a_press_renews_its_label_without_a_solve(tmp_path, label_all, solves):
    episode = press_episode(tmp_path)
    label_all([episode])
    episode.path.write_bytes(b"recorded again")
    assert label_all([episode]).written == [0]
    assert len(solves()) == 1


def test_another_sensor_file_gives_other_jobs(tmp_path, label_all, solves):
    softer = replace(SENSOR, material=replace(SENSOR.material, youngs_modulus=0.2))
    label_all([press_episode(tmp_path)])
    with pytest.raises(UsageError, match="another model version"):
        label_all([press_episode(tmp_path)], sensor=softer)
    assert label_all([press_episode(tmp_path)], sensor=softer, redo=True).written == [0]
    assert len(solves()) == 2


def test_a_refused_run_changes_nothing(tmp_path, label_all, monkeypatch):
    episodes = [press_episode(tmp_path, 0), press_episode(tmp_path, 1, x=1.0)]
    label_all(episodes)
    before = {p: p.read_bytes() for p in (tmp_path / "labels").glob("episode*")}
    monkeypatch.setenv("FAST_MODEL_VERSION", "2")
    with pytest.raises(UsageError, match="another model version"):
        label_all([episodes[0], replace(episodes[1], tip_ns=np.array([], dtype=np.int64))])
    assert before == {p: p.read_bytes() for p in (tmp_path / "labels").glob("episode*")}


def test_a_label_whose_recording_went_bad_is_put_aside_not_lost(tmp_path, label_all):
    episode = press_episode(tmp_path)
    label_all([episode])
    label = tmp_path / "labels" / "episode-000000.parquet"
    content = label.read_bytes()
    assert label_all([replace(episode, tip_ns=np.array([], dtype=np.int64))]).failed
    assert not label.exists() and label.with_suffix(".superseded").read_bytes() == content
