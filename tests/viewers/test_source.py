"""Real files in, scenes out; bad input ends in words."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_press import write_recording
from rerun.chunk import RrdReader

from tacdata import documents
from tacdata.dataset.frames import recording_hash
from tacdata.dataset.notes import add_note
from tacdata.dataset.pack import pack
from tacdata.errors import FormatError, UsageError
from tacdata.labels import write_label
from tacdata.recording.files.reader import read_episode
from tacdata.training.inference.prediction import write_prediction
from tacdata.viewers.rerun.backend import RerunBackend
from tacdata.viewers.source import scene_at


@pytest.fixture(scope="module")
def recorded(episode, images, tmp_path_factory):
    """The press as it comes back from its file, with the sample times that the reader estimates."""
    folder = tmp_path_factory.mktemp("session")
    return read_episode(write_recording(folder / "episode-000003.mcap", episode, images))


@pytest.fixture(scope="module")
def own_label(label, recorded):
    return replace(label, time_ns=recorded.taxels.sample_ns)


@pytest.fixture(scope="module")
def own_prediction(prediction, recorded):
    return replace(prediction, time_ns=recorded.taxels.sample_ns[2:])


@pytest.fixture(scope="module")
def session(recorded, own_label, own_prediction):
    folder = recorded.path.parent
    write_label(folder / "labels" / "episode-000003.parquet", own_label)
    other = replace(own_prediction, episode=0, time_ns=own_prediction.time_ns + 10**12)
    write_prediction(folder / "run" / "predictions" / "episode-000000.parquet", other)
    write_prediction(folder / "run" / "predictions" / "episode-000007.parquet", replace(own_prediction, episode=7))
    return folder


def test_a_recording_with_its_label_and_the_prediction_of_its_frames(session, own_label, own_prediction):
    scene = scene_at(session / "episode-000003.mcap", predictions=session / "run")
    assert [m.name for m in scene.maps] == ["label", "prediction", "error"]
    assert (scene.map_named("label").values == own_label.depth).all()
    assert (scene.map_named("prediction").time_ns == own_prediction.time_ns).all()
    assert [p.name for p in scene.phases] == ["rest", "approach", "press", "hold", "release"]
    assert len(scene.cameras[0].images) == 30 and scene.cameras[0].images[0][:2] == b"\xff\xd8"
    assert np.isnan(scene.cameras[0].cube_position[5:8]).all()
    assert scene.tip.values[:, 2].max() == pytest.approx(1.2, abs=0.01)


def test_a_session_shows_its_first_episode_or_the_one_asked_for(session):
    assert scene_at(session).title == scene_at(session, episode=3).title
    with pytest.raises(UsageError, match="--episode 4") as caught:
        scene_at(session, episode=4)
    assert caught.value.allowed == "3"


def test_notes_on_stretches_of_a_recording_stand_beside_its_phases(session, recorded, tmp_path):
    add_note(session, recording_hash(recorded), recorded.path.name, 1.0, 1.5, "the tool slips")
    add_note(session, "b" * 64, "another.mcap", 0.0, 1.0, "not this one")
    try:
        scene = scene_at(session)
    finally:
        (session / "notes.json").unlink()
    [note] = scene.notes
    first = scene.taxels.time_ns[0]
    assert (note.name, note.start_ns - first, note.end_ns - first) == ("the tool slips", 10**9, 1_500_000_000)
    RerunBackend(tmp_path / "e.rrd").draw(scene)
    assert "/notes" in {str(chunk.entity_path) for chunk in RrdReader(tmp_path / "e.rrd").stream()}
    assert scene_at(session).notes == ()


def test_labels_elsewhere(session, own_label, tmp_path):
    write_label(tmp_path / "episode-000003.parquet", replace(own_label, signed=0.5 * own_label.signed))
    scene = scene_at(session, labels=tmp_path)
    assert scene.map_named("label").values.max() == pytest.approx(0.5 * own_label.depth.max())


def test_a_failed_label_says_why(session, tmp_path):
    failure = {
        "version": "1.0",
        "kind": "solve",
        "reason": "no equilibrium at 1.1 mm",
        "failed_at": "2026-01-01T00:00:00",
        "code_version": "0",
    }
    documents.write(tmp_path / "episode-000003.failure.json", failure, "label_failure")
    scene = scene_at(session, labels=tmp_path)
    assert scene.maps == ()
    assert "no equilibrium at 1.1 mm" in scene.summary


def test_a_prediction_of_nothing_here_is_said(session, own_prediction, tmp_path):
    late = replace(own_prediction, time_ns=own_prediction.time_ns + 10**12)
    write_prediction(tmp_path / "episode-000000.parquet", late)
    scene = scene_at(session, predictions=tmp_path)
    assert [m.name for m in scene.maps] == ["label"]
    assert "no prediction of this episode" in scene.summary


def test_a_prediction_for_another_sensor_is_shown_with_a_warning(session, own_prediction, tmp_path):
    write_prediction(tmp_path / "episode-000000.parquet", replace(own_prediction, sensor="0" * 64))
    assert "another sensor" in scene_at(session, predictions=tmp_path).summary


def test_a_label_of_another_recording_is_said(session, own_label, tmp_path):
    write_label(tmp_path / "episode-000003.parquet", replace(own_label, time_ns=own_label.time_ns + 10**12))
    assert "not those of this recording" in scene_at(session, labels=tmp_path).summary


def test_a_truncated_recording_is_shown_as_far_as_it_goes(session, tmp_path):
    data = (session / "episode-000003.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 9 // 10])
    scene = scene_at(tmp_path / "cut.mcap")
    assert "interrupted or salvaged" in scene.summary
    assert len(scene.frame_ns) > 0


def test_a_recording_that_is_still_being_written(session, tmp_path):
    data = (session / "episode-000003.mcap").read_bytes()
    (tmp_path / "episode-000003.partial.mcap").write_bytes(data[: len(data) * 9 // 10])
    scene = scene_at(tmp_path)
    assert "still being written" in scene.summary and len(scene.frame_ns) > 0


def test_of_many_images_some_are_read_at_equal_distance(session):
    from tacdata.viewers.parts.recorded_images import recorded_images

    path = session / "episode-000003.mcap"
    whole = list(recorded_images(path, ("top",)))
    few = list(recorded_images(path, ("top",), most=4))
    assert few == [whole[k] for k in (0, 10, 19, 29)]
    data = path.read_bytes()
    (path.parent / "cut.mcap").write_bytes(data[:-200])  # without its index, it is read from the beginning
    assert list(recorded_images(path.parent / "cut.mcap", ("top",), most=4)) == few
    (path.parent / "cut.mcap").unlink()


def test_a_dataset_episode(session, recorded, own_label, tmp_path):
    parents = {**own_label.provenance["parents"], "recording": recording_hash(recorded)}
    whole = replace(own_label, provenance={**own_label.provenance, "parents": parents})
    pack([recorded], lambda _: whole, tmp_path / "set")
    scene = scene_at(tmp_path / "set", predictions=session / "run", episode=0)
    assert [m.name for m in scene.maps] == ["label", "prediction", "error"]
    assert np.allclose(scene.map_named("label").values, own_label.depth, atol=1e-6)
    assert [p.name for p in scene.phases] == ["rest", "approach", "press", "hold", "release"]
    assert scene.bodies[0].position[75] == pytest.approx([1.0, -0.5, 3.3 - 1.2], abs=1e-5)
    assert "sphere (radius 4" in scene.summary
    with pytest.raises(UsageError, match="--episode 1"):
        scene_at(tmp_path / "set", episode=1)
    with pytest.raises(UsageError, match="holds its labels"):
        scene_at(tmp_path / "set", labels=session / "labels")


def test_paths_that_cannot_be_viewed(session, tmp_path):
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "foreign.mcap").write_text("hello, this is no recording")
    for path, kind, words in (
        (tmp_path / "nowhere", UsageError, "no file or folder"),
        (tmp_path / "notes.txt", UsageError, "is no recording"),
        (tmp_path, UsageError, "no finished recording"),
        (tmp_path / "foreign.mcap", FormatError, "no MCAP file"),
    ):
        with pytest.raises(kind, match=words):
            scene_at(path)
    with pytest.raises(UsageError, match="no folder"):
        scene_at(session, labels=tmp_path / "missing")
    with pytest.raises(UsageError, match="no prediction in"):
        scene_at(session, predictions=tmp_path)
    with pytest.raises(UsageError, match="with one recording"):
        scene_at(session / "episode-000003.mcap", episode=3)


def test_a_damaged_prediction_is_named(session, tmp_path):
    (tmp_path / "episode-000000.parquet").write_bytes(b"PAR1nothing")
    with pytest.raises(FormatError, match="no readable prediction file"):
        scene_at(session, predictions=tmp_path)
