"""Bags of ROS 2: every topic at its own rate, in both storages, with the types that the bag describes."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign import press_data
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from running.in_process import tacdata

from tacdata.errors import FormatError, UsageError
from tacdata.example import copy_session
from tacdata.importing.formats.source_format import read_table, tables_in
from tacdata.importing.imported_session import import_session
from tacdata.importing.mapping import ReadOptions
from tacdata.recording.files.reader import read_episode

BEGIN = 1_743_486_221_000_000_000
STORES = {"mcap": (StoragePlugin.MCAP, ".mcap"), "sqlite3": (StoragePlugin.SQLITE3, ".db3")}
MAPPING = {
    "version": "1.2",
    "name": "bag",
    "files": {
        "board": {"path": "bag.mcap", "table": "/taxels", "time": {"column": "received", "unit": "ns"}},
        "stage": {"path": "bag.mcap", "table": "/stage", "time": {"column": "header.stamp", "unit": "ns"}},
    },
    "sensor": {"name": "bag"},
    "taxels": {"file": "board", "columns": "data", "unit": "pF"},
    "position": {"file": "stage", "depth": {"column": "point.x", "unit": "m"}},
}


def bag(folder: Path, storage: str, late: float = 0.0) -> Path:
    """A board at 100 Hz beside a stage at 30 Hz, and a camera; as `ros2 bag record` writes it."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg("float32[2] pair\nstring word", "lab_msgs/msg/Own"))
    floats, point, own = (
        types.types[f"{n}"]
        for n in ("std_msgs/msg/Float32MultiArray", "geometry_msgs/msg/PointStamped", "lab_msgs/msg/Own")
    )
    header, time = types.types["std_msgs/msg/Header"], types.types["builtin_interfaces/msg/Time"]
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    image = types.types["sensor_msgs/msg/Image"]
    plugin, ending = STORES[storage]
    seconds, depth, _, signals = press_data(rate=100.0)
    messages = []
    with Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        topics = {
            n: writer.add_connection(f"/{n}", kind.__msgtype__, typestore=types)
            for n, kind in (("taxels", floats), ("stage", point), ("lab", own), ("eye", image))
        }
        for t, row in zip(seconds, signals, strict=True):
            messages.append((t, "taxels", floats(layout=layout, data=row.astype(np.float32))))
        for t in np.arange(0, seconds[-1], 1 / 30):
            stamp = BEGIN + round(t * 1e9)
            head = header(stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="stage")
            place = types.types["geometry_msgs/msg/Point"](x=np.interp(t, seconds, depth) / 1000, y=0.0, z=0.0)
            messages.append((t + late, "stage", point(header=head, point=place)))
        messages.append((0.5, "lab", own(pair=np.array([1, 2], np.float32), word="a")))
        messages.append(
            (
                0.6,
                "eye",
                image(
                    header=head,
                    height=64,
                    width=96,
                    encoding="mono8",
                    is_bigendian=0,
                    step=96,
                    data=np.zeros(6144, np.uint8),
                ),
            )
        )
        for t, name, message in sorted(messages, key=lambda entry: entry[0]):
            raw = types.serialize_cdr(message, message.__msgtype__)
            writer.write(topics[name], BEGIN + round(t * 1e9), raw)
    return next((folder / "bag").glob(f"*{ending}"))


@pytest.mark.parametrize("storage", STORES)
def test_every_topic_keeps_its_own_rate(tmp_path, storage):
    path = bag(tmp_path, storage, late=0.02)
    assert tables_in(path) == ("/eye", "/lab", "/stage", "/taxels")
    document = yaml.safe_load(yaml.safe_dump(MAPPING))
    for entry in document["files"].values():
        entry["path"] = path.name
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(yaml.safe_dump(document))
    made = import_session(path, mapping, tmp_path / "session")
    assert made.recordings == 1 and not made.refused
    episode = read_episode(next(made.folder.glob("*.mcap")))
    seconds, depth, _, signals = press_data(rate=100.0)
    assert len(episode.taxels.sample_ns) == len(seconds), "100 Hz, beside 30 Hz"
    np.testing.assert_array_equal(episode.taxels.sample_ns - episode.taxels.sample_ns[0], np.rint(seconds * 1e9))
    assert np.allclose(episode.taxels.counts, signals, atol=1e-5)
    assert episode.press.depth == pytest.approx(depth.max(), abs=0.01)
    assert np.median(np.diff(episode.cnc.sample_ns)) == pytest.approx(1e9 / 30, rel=1e-3)


def test_own_types_images_and_stamps(tmp_path):
    path = bag(tmp_path, "mcap", late=0.5)
    own = read_table(path, ReadOptions(table="/lab"))
    assert own.columns["pair"].shape == (1, 2) and own.columns["word"].tolist() == ["a"]
    eye = read_table(path, ReadOptions(table="/eye"))
    assert "data" not in eye.columns and "6144 values a message is left out" in eye.notes[0]
    stage = read_table(path, ReadOptions(table="/stage"))
    assert next(iter(stage.columns)) == "header.stamp", "nearer to the measurement than the time of receipt"
    assert np.all(stage.columns["received"] - stage.columns["header.stamp"] == 500_000_000)
    with pytest.raises(UsageError, match="4 topics with numbers"):
        read_table(path)
    with pytest.raises(FormatError, match="no topic '/taxel'"):
        read_table(path, ReadOptions(table="/taxel"))


def test_a_mapping_is_proposed_from_all_topics(tmp_path):
    path = bag(tmp_path, "sqlite3")
    shown = tacdata("import", path.parent, "--propose", tmp_path / "mapping.yaml")
    assert shown.returncode == 0, shown.stderr
    assert "/taxels: 600 rows" in shown.stdout and "/stage: 180 rows" in shown.stdout
    proposed = yaml.safe_load((tmp_path / "mapping.yaml").read_text())
    assert {entry["table"] for entry in proposed["files"].values()} == {"/stage", "/taxels"}
    assert (proposed["taxels"]["file"], proposed["position"]["file"]) == ("taxels", "stage")
    assert proposed["files"]["stage"]["path"] == "bag.db3"
    assert proposed["files"]["stage"]["time"] == {"column": "header.stamp", "unit": "ns"}


def test_what_is_no_bag_is_said_in_words(tmp_path):
    made = tacdata("example", "first", "-q", folder=tmp_path)
    assert made.returncode == 0
    recording = next((tmp_path / "first").glob("*.mcap"))
    with pytest.raises(FormatError, match="no bag of ROS that can be read: it is a recording of tacdata") as error:
        tables_in(recording)
    assert "needs no import" in error.value.remedy
    cut = tmp_path / "cut.db3"
    cut.write_bytes(bag(tmp_path, "sqlite3").read_bytes()[:5000])
    with pytest.raises(FormatError):
        tables_in(cut)


def test_parts_of_a_message_that_are_not_taken_are_counted(tmp_path):
    """The transforms of one TF message, of a hand with 40 links."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    named = {name.rsplit("/", 1)[-1]: kind for name, kind in types.types.items()}
    head = named["Header"](stamp=named["Time"](sec=1, nanosec=0), frame_id="hand")
    pose = named["Transform"](
        translation=named["Vector3"](x=1.0, y=0.0, z=0.0), rotation=named["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    )
    links = [named["TransformStamped"](header=head, child_frame_id=f"link{k}", transform=pose) for k in range(40)]
    message = named["TFMessage"](transforms=links)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/tf", message.__msgtype__, typestore=types)
        writer.write(topic, BEGIN, types.serialize_cdr(message, message.__msgtype__))
    table = read_table(next((tmp_path / "bag").glob("*.mcap")), ReadOptions(table="/tf"))
    assert "transforms[31].transform.translation.x" in table.columns
    assert table.notes == ("bag.mcap: 1 messages of /tf have more than 32 parts in transforms: the first 32 are taken",)


def test_a_recording_becomes_a_bag_that_comes_back_as_it_was(tmp_path):
    example = runpy.run_path(str(Path(__file__).resolve().parents[3] / "examples" / "to_rosbag.py"))
    episode = read_episode(copy_session(tmp_path / "session") / "episode-000000.mcap")
    counts = example["write"](episode, tmp_path / "bag")
    assert counts == {"/taxels": len(episode.taxels.counts), "/tip": len(episode.tip)}
    (path,) = (tmp_path / "bag").glob("*.mcap")
    board = read_table(path, ReadOptions(table="/taxels"))
    np.testing.assert_array_equal(board.columns["data"], episode.taxels.counts)
    np.testing.assert_array_equal(board.columns["received"], episode.taxels.sample_ns)
    tip = read_table(path, ReadOptions(table="/tip"))
    np.testing.assert_allclose(tip.columns["point.z"], -episode.tip[:, 2] / 1000, atol=1e-9)
