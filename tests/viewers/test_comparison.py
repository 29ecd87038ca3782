"""Two labels, two networks, model and measurement: the difference is what it says, at equal times."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from recorded_press import write_recording

from tacdata.errors import UsageError
from tacdata.labels import write_label
from tacdata.recording.files.reader import read_episode
from tacdata.training.inference.prediction import write_prediction
from tacdata.viewers.comparison import labels_at, predictions_at, telling_names
from tacdata.viewers.pictures.backend import PictureBackend
from tacdata.viewers.pictures.film import FilmBackend, film_times
from tacdata.viewers.rerun.backend import RerunBackend
from tacdata.viewers.scenes.comparison import readings_comparison
from tacdata.viewers.scenes.episode import episode_scene


@pytest.fixture(scope="module")
def session(episode, label, images, prediction, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared") / "session"
    folder.mkdir()
    time = read_episode(write_recording(folder / "episode-000003.mcap", episode, images)).taxels.sample_ns
    own = replace(label, time_ns=time)
    write_label(folder / "labels" / "episode-000003.parquet", own)
    write_label(folder / "after" / "episode-000003.parquet", replace(own, signed=np.float32(0.9) * own.signed))
    for name, factor in (("one", 1.0), ("two", 0.5)):
        other = replace(prediction, time_ns=time[2:], depth=np.float32(factor) * prediction.depth)
        write_prediction(folder / name / "predictions" / "episode-000000.parquet", other)
    return folder


def test_two_labels_and_their_difference(session, label, tmp_path):
    scene = labels_at(session, [session / "after"], None)
    assert [m.name for m in scene.maps] == ["labels", "after", "after − labels"]
    first, second, difference = scene.maps
    assert first.scale == second.scale and difference.scale.signed
    assert np.allclose(difference.values, -0.1 * np.maximum(label.signed, 0), atol=1e-6)
    assert [s.name for s in scene.surfaces] == ["labels", "after"]
    RerunBackend(tmp_path / "c.rrd").draw(scene)
    PictureBackend(tmp_path / "c.png", resolution=20).draw(scene)
    assert (tmp_path / "c.rrd").stat().st_size > 10_000


def test_two_networks_and_each_ones_error(session, prediction, label):
    scene = predictions_at(session, [session / "one", session / "two"], 3)
    names = [m.name for m in scene.maps]
    assert names == ["label", "one", "two", "two − one", "one − label", "two − label"]
    maps = dict(zip(names, scene.maps, strict=True))
    assert np.allclose(maps["two − one"].values, -0.5 * prediction.depth, atol=1e-6)
    assert np.allclose(maps["one − label"].values, prediction.depth - np.maximum(label.signed[2:], 0), atol=1e-5)
    assert len({(m.scale.low, m.scale.high) for m in scene.maps if m.scale.signed}) == 1, "differences share a scale"


def test_what_cannot_be_compared(session, tmp_path):
    with pytest.raises(UsageError, match="3 times"):
        labels_at(session, [session / "after"] * 3, None)
    with pytest.raises(UsageError, match="no folder"):
        labels_at(session, [tmp_path / "none"], None)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="no label"):
        labels_at(session, [tmp_path / "empty"], None)
    with pytest.raises(UsageError, match="1 times"):
        predictions_at(session, [session / "one"], None)


def test_a_model_beside_what_was_measured(tmp_path):
    time = (1e7 * np.arange(50)).astype(np.int64)
    measured = 100 + np.outer(np.sin(np.arange(50) / 8), np.arange(24.0))
    said = {"base": measured + 1.0, "with creep": measured - 0.5}
    scene = readings_comparison("t", (6, 4), time, measured, said, "counts")
    off = next(c for c in scene.curves if c.name == "root mean square left")
    assert off.labels == ("base", "with creep")
    assert np.allclose(off.values, [1.0, 0.5])
    left = next(a for a in scene.arrays if a.name == "measured − base")
    assert left.grid.shape == (50, 4, 6) and np.allclose(left.values, -1.0)
    RerunBackend(tmp_path / "c.rrd").draw(scene)
    PictureBackend(tmp_path / "c.png", resolution=20).draw(scene)


def test_names_tell_folders_apart(tmp_path):
    assert telling_names([tmp_path / "a" / "labels", tmp_path / "b" / "labels"]) == ["a/labels", "b/labels"]
    assert telling_names([tmp_path / "x.json", tmp_path / "x.json"]) == ["x.json 1", "x.json 2"]


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_a_film_shows_the_press_from_approach_to_release(episode, label, tmp_path, monkeypatch, ending):
    monkeypatch.setattr("tacdata.viewers.pictures.film.MOST", {".gif": 3, ".mp4": 3})
    scene = episode_scene(episode, label)
    FilmBackend(tmp_path / f"film{ending}", resolution=30).draw(scene)
    if ending == ".gif":
        with Image.open(tmp_path / "film.gif") as film:
            assert film.n_frames == 3
    else:
        import av

        with av.open(str(tmp_path / "film.mp4")) as film:
            pictures = [f.to_ndarray(format="rgb24") for f in film.decode(video=0)]
        assert len(pictures) == 3
        assert np.abs(pictures[0].astype(int) - pictures[1]).max() > 50, "the skin moves"
    times = film_times(scene, 10.0, 1000)
    assert times[0] == scene.phases[1].start_ns and len(times) == 26


def test_films_of_other_scenes_and_endings_are_refused(tmp_path):
    scene = readings_comparison("t", (6, 4), np.arange(3), np.zeros((3, 24)), {"m": np.ones((3, 24))}, "counts")
    with pytest.raises(UsageError, match="a film of"):
        FilmBackend(tmp_path / "f.gif").draw(scene)
    with pytest.raises(UsageError, match=r"\.mp4 or \.gif"):
        FilmBackend(tmp_path / "f.avi")
    assert list(tmp_path.iterdir()) == []
