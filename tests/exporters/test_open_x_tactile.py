"""Stores in the layout of Open-X-Tactile: as its description says, opened by zarr, and imported again."""

import cv2
import numpy as np
import pytest
import yaml
import zarr
from running.in_process import tacdata
from scipy.spatial.transform import Rotation
from test_exporters import GAINS, demonstration

from tacdata.demonstrations.recording import images
from tacdata.errors import UsageError
from tacdata.exporters import open_x_tactile
from tacdata.exporters.exporter import exporter
from tacdata.importing.formats.source_format import read_table
from tacdata.importing.imported_session import import_session
from tacdata.recording.files.reader import read_episode
from tacdata.replay.targets import targets_of

STREAMS = {
    "timestamps",
    "sub_task_instruction",
    "right_wrist_pose",
    "right_hand_joints",
    "right_hand_joints_idx",
    *(
        f"right_tactile_{part}_{group}"
        for part in ("data", "area", "sensor", "type")
        for group in ("fingertips", "predicteddepth")
    ),
}


@pytest.fixture
def store(tmp_path):
    episodes = [targets_of(demonstration(number=k), GAINS) for k in range(2)]
    remarks = exporter("open_x_tactile").write(episodes, tmp_path / "out")
    assert len(remarks) == 1 and "no RGB stream" in remarks[0]
    return tmp_path / "out" / "grasp.zarr", episodes


def test_the_layout_is_that_of_the_public_description(store):
    folder, _ = store
    root = zarr.open_group(str(folder), mode="r", zarr_format=2)
    assert root["meta/episode_ends"][:].tolist() == [38, 76]
    assert set(root["data"].array_keys()) == STREAMS
    assert {array.shape[0] for _, array in root["data"].arrays()} == {76}, "time first in every array"
    assert root["data/timestamps"][:].tolist() == [*range(38), *range(38)]
    assert set(np.char.strip(root["data/sub_task_instruction"][:])) == {"grasp"}
    assert root["data/right_tactile_data_fingertips"].shape == (76, 2, 4, 6)
    assert root["data/right_tactile_area_fingertips"][0].tolist() == [0, 1], "thumb and index"
    assert set(root["data/right_tactile_type_fingertips"][:]) == {"state"}
    assert root["data/right_tactile_data_predicteddepth"].shape == (76, 2, 35, 26)
    assert set(root["data/right_tactile_sensor_predicteddepth"][:]) == {"tacprint predicted mm"}


def test_poses_openings_and_readings_are_those_of_the_targets(store):
    folder, episodes = store
    root, targets = zarr.open_group(str(folder), mode="r", zarr_format=2), episodes[1]
    pose = root["data/right_wrist_pose"][38:]
    assert np.allclose(pose[:, :3], targets.position.mean(axis=1), atol=1e-6)
    assert np.allclose(
        Rotation.from_rotvec(pose[:, 3:]).as_matrix(),
        Rotation.from_quat(targets.quaternion[:, 0]).as_matrix(),
        atol=1e-6,
    )
    opening = np.linalg.norm(targets.position[:, 0] - targets.position[:, 1], axis=1)
    assert np.allclose(root["data/right_hand_joints"][38:, 0], opening, atol=1e-6)
    assert set(root["data/right_hand_joints_idx"][:, 0]) == {28}
    signals = targets.source.tracks["index"].signals[targets.rows]
    # Taxel k = i + 6 j of column i and row j.
    assert np.array_equal(root["data/right_tactile_data_fingertips"][38:, 1, 2, 5], signals[:, 5 + 6 * 2])


def test_the_last_image_before_each_row_is_taken(tmp_path, monkeypatch):
    targets = targets_of(demonstration(), None)
    (tmp_path / targets.recording).touch()
    shades = [cv2.imencode(".png", np.full((48, 64, 3), (10 * k, 0, 255), np.uint8))[1].tobytes() for k in range(20)]
    every = targets.time_ns[::2]
    monkeypatch.setattr(images, "stored_images", lambda path: (every, shades[: len(every)]))
    assert exporter("open_x_tactile", recordings=tmp_path).write([targets], tmp_path / "out") == []
    shown = zarr.open_group(str(tmp_path / "out" / "grasp.zarr"), mode="r", zarr_format=2)["data/camera_main_rgb"]
    assert shown.shape == (38, 224, 224, 3)
    assert shown[:, 100, 100].tolist() == [[255, 0, 10 * (k // 2)] for k in range(38)], "red first: RGB"


def test_a_store_is_imported(store, tmp_path):
    folder, episodes = store
    table = read_table(folder)
    assert table.columns["right_tactile_data_fingertips"].shape == (76, 48)
    assert np.bincount(table.columns["episode"].astype(int)).tolist() == [38, 38]
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(
        yaml.safe_dump(
            {
                "version": "1.2",
                "name": "public",
                "files": {"all": {"path": "grasp.zarr", "time": {"rate": 30.0}}},
                "sensor": {"name": "fingertips"},
                "trials": {"column": "episode"},
                "position": {"file": "all", "depth": -1},
                "taxels": {"file": "all", "columns": "right_tactile_data_fingertips", "unit": "counts"},
            }
        )
    )
    for source in (folder, folder.parent):
        made = import_session(source, mapping, tmp_path / f"session_{source.suffix}")
        assert made.recordings == 2 and not made.refused
    readings = read_episode(sorted(made.folder.glob("*.mcap"))[1]).taxels.counts
    assert np.allclose(readings[:, 24:], episodes[1].source.tracks["index"].signals[episodes[1].rows], atol=1e-3)


def test_wide_arrays_are_left_out_and_named(tmp_path, monkeypatch):
    open_x_tactile._array(tmp_path / "a.zarr/data/eye", np.zeros((5, 96, 96, 3), np.uint8))
    open_x_tactile._array(tmp_path / "a.zarr/data/force", np.arange(5.0))
    table = read_table(tmp_path / "a.zarr")
    assert list(table.columns) == ["force"] and "data/eye of 96 x 96 x 3 values a row is left out" in table.notes[0]


def test_other_boards_in_one_task_are_refused(tmp_path):
    one, other = targets_of(demonstration(), None), targets_of(demonstration(network=None), None)
    with pytest.raises(UsageError, match="other fingers or boards"):
        exporter("open_x_tactile").write([one, other], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("form", ["open_x_tactile", "lerobot", "csv"])
def test_a_session_of_presses_is_exported_too(tmp_path, form):
    assert tacdata("example", tmp_path / "first", "-q").returncode == 0
    shown = tacdata("export", tmp_path / "first", "--out", tmp_path / "out", "--format", form)
    assert shown.returncode == 0, shown.stderr
    assert "in frame 'sensor'" in shown.stdout
    again = sorted(exporter(form).read(tmp_path / "out"), key=lambda targets: targets.recording)
    recordings = sorted((tmp_path / "first").glob("*.mcap"))
    for targets, path in zip(again, recordings, strict=True):
        episode = read_episode(path)
        assert np.array_equal(targets.time_ns, episode.taxels.sample_ns), "every reading, at its own time"
        deepest = -1000 * targets.position[:, 0, 2].min()
        assert deepest == pytest.approx(episode.press.depth, abs=0.02)
    if form == "open_x_tactile":
        stores = [zarr.open_group(str(p), mode="r", zarr_format=2) for p in sorted((tmp_path / "out").glob("*.zarr"))]
        readings = np.concatenate([store["data/right_tactile_data_fingertips"][:] for store in stores])
        assert readings.shape[1:] == (1, 4, 6) and len(readings) == sum(len(t.time_ns) for t in again)
