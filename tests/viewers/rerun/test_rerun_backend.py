"""What was written is read back with Rerun's own reader and its own command line."""

import subprocess
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tacdata.errors import UsageError
from tacdata.viewers.rerun.backend import RerunBackend
from tacdata.viewers.rerun.window import executable
from tacdata.viewers.scenes.episode import episode_scene


@pytest.fixture(scope="module")
def file(episode, label, prediction, images, tmp_path_factory):
    path = tmp_path_factory.mktemp("rerun") / "episode.rrd"
    RerunBackend(path).draw(episode_scene(episode, label, prediction, images))
    return path


@pytest.fixture(scope="module")
def chunks(file):
    return [chunk for chunk in RrdReader(file).stream() if not str(chunk.entity_path).startswith("/__")]


def column(chunks, path, component):
    """Return a component's rows as lists, and the rows' host times and device frames."""
    values, host, device = [], [], []
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) == path and not chunk.is_static and component in batch.schema.names:
            values += batch[component].to_pylist()
            host += batch["host_time"].cast("int64").to_pylist()
            device += batch["device_frame"].to_pylist()
    order = np.argsort(host)
    return [values[k] for k in order], np.array(host)[order], np.array(device)[order]


def test_the_entities_and_their_rows(chunks):
    rows = Counter()
    for chunk in chunks:
        if not chunk.is_static:
            assert set(chunk.timeline_names) == {"host_time", "device_frame"}
            rows[str(chunk.entity_path)] += chunk.num_rows
    assert rows == {
        "/heat_map": 120,
        "/world/taxels": 120,
        "/world/skin/label": 120,
        "/world/skin/prediction": 118,
        "/world/indenter": 120,
        "/maps/label": 120,
        "/maps/prediction": 118,
        "/maps/error": 118,
        "/maps/marks/tip": 120,
        "/curves/taxels/change": 120,
        "/curves/taxels/raw": 120,
        "/curves/clock/taxels": 120,
        "/curves/clock/guide": 30,
        "/contact/contact": 120,
        "/curves/tip/nominal": 120,
        "/curves/tip/reported": 30,
        "/curves/tags/top/position": 30,
        "/curves/tags/top/reprojection": 30,
        "/curves/tags/top/faces": 30,
        "/curves/force": 120,
        "/curves/error": 118,
        "/cameras/top/image": 30,
        "/cameras/top/cube": 30,
        "/phase": 6,
    }


def test_maps_keep_their_millimetres_and_both_times(chunks, episode, label):
    buffers, host, device = column(chunks, "/maps/label", "DepthImage:buffer")
    picture = np.array(buffers[75][0], dtype=np.uint8).view(np.float32).reshape(26, 35)
    assert (picture[::-1].T == label.depth[75]).all()
    assert (host == episode.taxels.sample_ns).all()
    assert (device == episode.taxels.counter).all()


def test_marks_lie_on_the_pixels_of_their_own_map(episode, label, tmp_path):
    """The protrusions' map has other pixels than the others: taxel 0 is marked at its middle in both."""
    pressed = replace(label, taxel_pressure=np.full((len(label.time_ns), 24, 10, 10), 0.01, np.float16))
    RerunBackend(tmp_path / "e.rrd").draw(episode_scene(episode, pressed))
    marks = {}
    for chunk in RrdReader(tmp_path / "e.rrd").stream():
        path, batch = str(chunk.entity_path), chunk.to_record_batch()
        if path.endswith("/taxels") and path.startswith("/maps") and chunk.is_static:
            marks[path] = batch["Points2D:positions"].to_pylist()[0][0]
    assert marks["/maps/marks/taxels"] == pytest.approx(((-4.75 + 7.0) / 0.4, 26 - (-3.75 + 5.2) / 0.4))
    assert marks["/maps/marks_board/taxels"] == pytest.approx((5.0, 53 - 5.0), abs=0.5)


def test_curves_keep_their_values(chunks, episode):
    rows, _, _ = column(chunks, "/curves/taxels/raw", "Scalars:scalars")
    assert np.allclose(rows, episode.taxels.counts)


def test_the_skin_and_the_indenter_stand_where_they_should(chunks, episode, label):
    vertices, _, _ = column(chunks, "/world/skin/label", "Mesh3D:vertex_positions")
    heights = np.array(vertices[75])[:, 2].reshape(35, 26)
    assert np.allclose(heights, 3.3 - label.signed[75], atol=1e-6)
    tips, _, _ = column(chunks, "/world/indenter", "Transform3D:translation")
    assert np.allclose(tips[75][0], [1.0, -0.5, 3.3 - 1.2], atol=1e-6)


def test_a_cube_out_of_sight_has_no_axes(chunks):
    vectors, _, _ = column(chunks, "/cameras/top/cube", "Arrows3D:vectors")
    assert [len(v) for v in vectors[4:9]] == [3, 0, 0, 0, 3]
    assert np.linalg.norm(vectors[4], axis=1) == pytest.approx(20.0, rel=1e-5)


def test_phases_change_state_and_end(chunks):
    states, _, _ = column(chunks, "/phase", "StateChange:state")
    assert [s[0] for s in states] == ["rest", "approach", "press", "hold", "release", ""]


def test_the_file_brings_its_layout_and_stock_rerun_finds_no_fault(file):
    assert len(RrdReader(file).blueprints()) == 1
    checked = subprocess.run([executable(), "rrd", "verify", str(file)], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
    assert "without error" in checked.stdout + checked.stderr


def test_a_recording_alone_is_drawn_too(episode, tmp_path):
    RerunBackend(tmp_path / "bare.rrd").draw(episode_scene(episode))
    names = {str(c.entity_path) for c in RrdReader(tmp_path / "bare.rrd").stream()}
    assert "/world/skin/undeformed" in names
    assert not any(name.startswith("/maps") for name in names)
    assert [p.name for p in tmp_path.iterdir()] == ["bare.rrd"]


def test_nothing_is_overwritten_and_the_ending_is_checked(tmp_path):
    (tmp_path / "there.rrd").write_text("mine")
    with pytest.raises(UsageError, match="exists"):
        RerunBackend(tmp_path / "there.rrd")
    assert (tmp_path / "there.rrd").read_text() == "mine"
    with pytest.raises(UsageError, match=r"ends in \.rrd"):
        RerunBackend(tmp_path / "film.mp4")
