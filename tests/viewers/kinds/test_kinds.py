"""Every kind of path becomes a scene that both backends draw; what means nothing for it is refused in words."""

import json

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tacdata import documents, registry, schemas
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.demonstrations.paths.tracks_file import read_tracks, write_tracks
from tacdata.discrepancy.verdict.residual_table import Residuals
from tacdata.discrepancy.verdict.residual_table import write as write_residuals
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import exporter
from tacdata.replay.targets import targets_of
from tacdata.sensor import default_sensor
from tacdata.training.inference.prediction import write_prediction
from tacdata.viewers.kinds.kind import BASE, ROOM, kinds
from tacdata.viewers.pictures.backend import PictureBackend
from tacdata.viewers.rerun.backend import LAYOUTS, RerunBackend
from tacdata.viewers.rerun.bar_table import bar_table
from tacdata.viewers.rerun.gap_recording import write as write_gap
from tacdata.viewers.scene.scene import Bars, MotionTrail
from tacdata.viewers.scenes.prediction import prediction_scene
from tacdata.viewers.source import scene_at

START = 1_760_000_000_000_000_000
GRID = 60


@pytest.fixture(scope="module")
def tracks(episode, label, tmp_path_factory):
    """A finger that comes down on something; between 0.5 and 0.7 s nobody saw it."""
    seconds = np.arange(GRID) / 30
    position = np.column_stack([0.01 * seconds, np.zeros(GRID), 0.1 - 0.02 * seconds])
    position[:2] = np.nan
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (GRID, 1))  # turned about x: the pad looks down
    depth = np.maximum(label.signed[:GRID], 0).astype(np.float32)
    depth[50] = 0.5
    track = FingerTrack(
        "index",
        "right",
        "index",
        position,
        quaternion,
        np.tile(1e-6 * np.eye(6), (GRID, 1, 1)),
        (seconds > 0.5) & (seconds < 0.7),
        50,
        1,
        np.zeros((GRID, 24), np.float32),
        depth,
    )
    network = {"hash": "a" * 64, "network": "paper", "epoch": 1, "lookahead": 4, "sensor": "b" * 64}
    made = Demonstration(
        "episode-000000.mcap",
        "c" * 64,
        "grasp",
        "table",
        30.0,
        START + (1e9 * seconds).astype(np.int64),
        {"index": track},
        {"index": episode.sensor},
        {},
        network,
        ("a made-up finger",),
        {"made_by": "test", "code_version": "0", "made_at": "2026-01-01T00:00:00", "parents": {}, "parameters": {}},
    )
    path = tmp_path_factory.mktemp("hand") / "episode-000000.tracks.parquet"
    write_tracks(path, made)
    return path


def drawn(scene, folder):
    """Draw a scene both ways and return the entities of the Rerun file."""
    RerunBackend(folder / "scene.rrd").draw(scene)
    PictureBackend(folder / "scene.png", resolution=20).draw(scene)
    assert (folder / "scene.png").stat().st_size > 5_000
    assert len(RrdReader(folder / "scene.rrd").blueprints()) == 1
    return {str(chunk.entity_path) for chunk in RrdReader(folder / "scene.rrd").stream()}


def test_every_kind_has_its_place_and_its_noun():
    found = kinds()
    assert len(found) == len(registry.names(ROOM, BASE))
    assert len({kind.ORDER for kind in found}) == len(found), "two kinds with one place"
    assert found[-1].NOUN == "a session folder", "which claims every folder"


def test_tracks_stand_in_space_with_what_was_felt(tracks, tmp_path):
    scene = scene_at(tracks)
    assert scene.kind in LAYOUTS
    assert "no recording next to the tracks" in scene.summary and "a made-up finger" in scene.summary
    body = scene.bodies[0]
    assert len(body.position) == GRID - 2, "times without a pose are left out"
    cloud = scene.clouds[0]
    row = 50
    first = int(cloud.count[:row].sum())
    points = cloud.position[first : first + cloud.count[row]]
    assert cloud.count[row] == 35 * 26
    # The pad looks down, so a skin pressed in by 0.5 mm is 0.5 mm above the fingertip.
    assert points[:, 2] == pytest.approx(100 - 20 * 50 / 30 + 0.5, abs=1e-6)
    found = drawn(scene, tmp_path)
    assert {"/world/index", "/world/paths/index/seen", "/world/paths/index/bridged", "/contact/index"} <= found
    assert "/maps/predicted_index" in found and "/curves/predicted_depth" in found


@pytest.mark.parametrize("form", ["csv", "parquet", "lerobot"])
def test_targets_of_every_format(tracks, tmp_path, form):
    targets = targets_of(read_tracks(tracks), {"index": 0.004})
    exporter(form).write([targets, targets] if form == "lerobot" else [targets], tmp_path / "out")
    scene = scene_at(tmp_path / "out")
    assert [t.name for t in scene.trails] == ["index/seen", "index/target"]
    moved = next(c for c in scene.curves if c.name == "moved/index")
    assert moved.values.max() == pytest.approx(1000 * np.abs(targets.position - targets.seen).max(), rel=1e-3)
    assert "/world/paths/index/target/seen" in drawn(scene, tmp_path)
    with pytest.raises(UsageError, match="--episode 7"):
        scene_at(tmp_path / "out", episode=7)


def test_predictions_alone(prediction, tmp_path):
    write_prediction(tmp_path / "run" / "predictions" / "episode-000004.parquet", prediction)
    scene = scene_at(tmp_path / "run" / "predictions")
    assert "in pixels" in scene.summary and "estimate" in scene.summary
    assert (scene.maps[0].values == prediction.depth).all()
    assert "/maps/prediction" in drawn(scene, tmp_path)
    # With the checkpoint beside it the skin is known, its taxels' readings are not.
    known = prediction_scene("run", prediction, default_sensor(), 1)
    assert known.footprint is not None and not known.arrays
    (tmp_path / "known").mkdir()
    assert "/world/footprint" in drawn(known, tmp_path / "known")
    with pytest.raises(UsageError, match="--episode 3") as caught:
        scene_at(tmp_path / "run" / "predictions", episode=3)
    assert caught.value.allowed == "4"


@pytest.fixture
def verdict(tmp_path):
    effect = {
        "mechanism": "creep",
        "effect": "creep",
        "title": "The skin creeps",
        "stage": "skin",
        "moves": ["signal"],
        "status": "named",
        "alternatives": [],
        "parameters": {"tau": {"value": 2.0, "unit": "s", "error": 0.1}},
        "margins": {"relaxation": 3.5, "drift": 7.0},
        "necessity": 9.0,
        "at_bound": [],
        "experiment": "pull it off",
    }
    document = {
        "version": schemas.version("verdict"),
        "status": "named",
        "why": "creep is missing",
        "effects": [effect],
        "gate": {"gap": True, "p": 0.001, "p_generic": 0.001, "noise": [1.0], "memory": 0.0},
        "left": {"share": 0.01, "t": 0.3, "before": 8.0, "after": 1.1, "floor": 1.0},
        "located": ["phase: hold"],
        "unjudgeable": {"rotation": "one place", "relaxation_let_go": "loads", "power_creep_let_go": "loads"},
        "limits": {"creep": 0.02, "relaxation": 0.03, "power_creep": 0.01, "drift": None, "tilt": 4.0},
        "untested": [],
        "data": {},
        "remarks": ["one indenter"],
        "next": ["hold longer"],
        "provenance": {"made_by": "t", "code_version": "0", "made_at": "x", "parents": {}, "parameters": {}},
    }
    documents.write(tmp_path / "verdict" / "verdict.json", document, "verdict")
    return tmp_path / "verdict"


def test_a_verdict_in_words_and_bars(verdict, tmp_path):
    scene = scene_at(verdict)
    assert "named" in scene.summary and "tau = 2 ± 0.1 s" in scene.summary and "hold longer" in scene.summary
    bars = {b.name: b for b in scene.bars}
    assert bars["gap"].values.tolist() == [8.0, 1.1, 1.0]
    assert bars["margins/creep"].labels == ("relaxation", "drift")
    assert bars["limits"].labels == ("relaxation", "creep", "tilt"), "what is not excited has no bar"
    assert bars["limits"].values.tolist() == [0.01, 0.02, 4.0], "of several forms of a mechanism the smallest"
    assert "Cannot be judged here: rotation." in scene.summary, "by the names of tacdata list effects"
    assert {"/bars/gap", "/bars/limits", "/about"} <= drawn(scene, tmp_path)
    assert scene_at(verdict / "verdict.json").bars[0].labels == scene.bars[0].labels


def test_only_these_recordings_are_evidence_and_an_experiment_is_proposed_where_a_rival_is_open(verdict):
    summary = scene_at(verdict).summary
    assert "distinguished in these recordings from: relaxation by 3.5, drift by 7.0 standard errors" in summary
    assert "pull it off" not in summary
    document = documents.read(verdict / "verdict.json", "verdict")
    document["effects"][0]["alternatives"] = ["relaxation"]
    documents.write(verdict / "verdict.json", document, "verdict")
    summary = scene_at(verdict).summary
    assert "from: drift by 7.0" in summary and "an experiment that would distinguish them: pull it off" in summary


def test_a_verdict_shows_its_readings_beside_the_model(verdict, tmp_path):
    rng, rows = np.random.default_rng(0), 300
    measured = rng.normal(size=(rows, 2)).astype(np.float32)
    told = Residuals(
        np.repeat(np.arange(3), 100).astype(np.int32),
        np.arange(rows) * 0.1,
        np.zeros(rows, np.int8),
        np.zeros(rows, np.float32),
        np.zeros(rows, np.float32),
        measured,
        measured - [1.0, 5.0],
        measured * 1.0,
        np.ones(2),
        ("channel 0", "channel 3"),
        ("hold",),
        ("a", "b", "c"),
    )
    write_residuals(verdict / "residuals.parquet", told, "a" * 64)
    scene = scene_at(verdict)
    assert [c.name for c in scene.curves][:2] == ["readings/channel_3", "residuals/channel_3"], "most to see first"
    assert "/curves/residuals/channel_0" in drawn(scene, tmp_path)
    assert np.nanmax(np.abs(scene.curves[1].values[:, 1])) < 1e-6


def test_options_that_mean_nothing_are_refused(verdict, tracks):
    with pytest.raises(UsageError, match="--labels"):
        scene_at(verdict, labels=verdict)
    with pytest.raises(UsageError, match="--episode 1"):
        scene_at(tracks, episode=1)


def test_damaged_files_are_named(verdict, tracks, tmp_path):
    (verdict / "verdict.json").write_text(json.dumps({"version": "1.0"}))
    with pytest.raises(FormatError, match=r"verdict\.json"):
        scene_at(verdict)
    torn = tmp_path / "torn.tracks.parquet"
    torn.write_bytes(tracks.read_bytes()[:900])
    with pytest.raises(FormatError, match="torn"):
        scene_at(torn)


def test_the_curves_of_a_revision_are_read_back(tmp_path):
    from types import SimpleNamespace

    from tacdata.viewers.rerun.gap_curves import read_gap_curves

    time = np.linspace(0, 2, 30)
    values = np.outer(np.sin(time), [1.0, 2.0])
    own = SimpleNamespace(
        name="episode-000003",
        time=time,
        depth=time,
        measured=values,
        before=2 * values,
        after=values,
        channel=1,
        channel_name="channel 7",
    )
    write_gap([own], tmp_path / "gap.rrd", "gap")
    (curves,) = read_gap_curves(tmp_path / "gap.rrd")
    assert curves.labels == ("measured", "before", "after")
    assert np.allclose(curves.values[:, 1], 2 * values[:, 1]) and curves.time_ns[-1] == 2_000_000_000
    (tmp_path / "bad.rrd").write_bytes(b"RRF2nothing")
    with pytest.raises(FormatError, match="cannot be read"):
        read_gap_curves(tmp_path / "bad.rrd")


def test_a_trail_breaks_where_nothing_is_known_and_bridges_join_what_is():
    place = np.arange(30.0).reshape(10, 3)
    place[7] = np.nan
    doubtful = np.zeros(10, bool)
    doubtful[3:5] = True
    trail = MotionTrail("t", place, doubtful)
    assert [len(s) for s in trail.strips(False)] == [3, 2, 2]
    (bridge,) = trail.strips(True)
    assert bridge[0].tolist() == place[2].tolist() and bridge[-1].tolist() == place[5].tolist()


def test_bars_as_a_table_carry_names_values_and_the_mark():
    text = bar_table(Bars("limits", "t", ("small", "large", "none"), np.array([0.01, 10.0, np.nan]), 1.0, True))
    small, large, none = text.splitlines()[2:5]
    assert "0.01" in small and large.count("█") > small.count("█") > 0
    assert "▲" in large and "▲" not in small and "unknown" in none


def test_the_layout_for_foxglove_names_only_what_the_recording_has(episode, images, tmp_path):
    import re

    from recorded_press import write_recording

    from tacdata.recording.files.mcap_records import read_records
    from tacdata.schemas import tacdata_pb2
    from tacdata.viewers.foxglove_layout import write_foxglove_layout

    recording = write_recording(tmp_path / "episode-000003.mcap", episode, images)
    write_foxglove_layout(recording, tmp_path / "layout.json")
    layout = json.loads((tmp_path / "layout.json").read_text())
    records = read_records(recording, images=False)
    messages = {c.topic: records.schemas[c.schema_id].name.split(".")[-1] for c in records.channels.values()}
    names = set()

    def walk(node):
        for child in [node] if isinstance(node, str) else [node["first"], node["second"]]:
            names.add(child) if isinstance(child, str) else walk(child)

    walk(layout["layout"])
    assert names == set(layout["configById"]) and "Image!camera-top-image" in names
    plotted = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", [])]
    assert "/taxels.counts[:]" in plotted
    assert layout["configById"]["3D!camera-top-image"]["topics"].keys() == {"/camera/top/pose"}
    for path in plotted:
        topic, field = re.fullmatch(r"(/[\w/]+)\.(\w+).*", path).groups()
        assert field in getattr(tacdata_pb2, messages[topic]).DESCRIPTOR.fields_by_name, path
    with pytest.raises(UsageError, match="exists"):
        write_foxglove_layout(recording, tmp_path / "layout.json")


def test_images_and_poses_are_of_foxglove_s_own_schemas_field_by_field(episode, images, tmp_path):
    """What the file says of a message type is what Foxglove publishes of it, for that type and all that it holds."""
    from foxglove_schemas_protobuf import CompressedImage_pb2, PoseInFrame_pb2
    from google.protobuf import descriptor_pool
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from mcap.reader import make_reader
    from recorded_press import write_recording

    def fields(kind, seen=()):
        own = {
            f.name: (f.number, f.type, f.is_repeated, f.message_type and f.message_type.full_name) for f in kind.fields
        }
        inner = [f.message_type for f in kind.fields if f.message_type and f.message_type.full_name not in seen]
        below = [fields(each, (*seen, each.full_name)) for each in inner]
        return {kind.full_name: own, **{name: told for each in below for name, told in each.items()}}

    with write_recording(tmp_path / "episode-000003.mcap", episode, images).open("rb") as stream:
        schemas_there = {schema.name: schema.data for schema in make_reader(stream).get_summary().schemas.values()}
    published = {
        "foxglove.CompressedImage": CompressedImage_pb2.CompressedImage,
        "foxglove.PoseInFrame": PoseInFrame_pb2.PoseInFrame,
    }
    for name, kind in published.items():
        pool = descriptor_pool.DescriptorPool()
        for file in FileDescriptorSet.FromString(schemas_there[name]).file:
            pool.Add(file)
        assert fields(pool.FindMessageTypeByName(name)) == fields(kind.DESCRIPTOR)
    assert len(fields(PoseInFrame_pb2.PoseInFrame.DESCRIPTOR)) == 5, (
        "pose, vector, quaternion and time are compared too"
    )


def test_foxglove_reads_a_recording_by_the_schemas_that_it_carries(episode, images, tmp_path):
    """By descriptors from the file alone: names and fields are those that Foxglove documents."""
    from google.protobuf import descriptor_pool, message_factory
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from mcap.reader import make_reader
    from recorded_press import write_recording

    recording, found = write_recording(tmp_path / "episode-000003.mcap", episode, images), {}
    with recording.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            if channel.topic in found:
                continue
            pool = descriptor_pool.DescriptorPool()
            for file in FileDescriptorSet.FromString(schema.data).file:
                pool.Add(file)
            kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found[channel.topic] = (schema.name, kind.FromString(message.data))
    assert {topic: found[topic][0] for topic in ("/camera/top/image", "/camera/top/pose")} == {
        "/camera/top/image": "foxglove.CompressedImage",
        "/camera/top/pose": "foxglove.PoseInFrame",
    }
    image, pose = found["/camera/top/image"][1], found["/camera/top/pose"][1]
    assert image.format == "jpeg" and image.data[:2] == b"\xff\xd8"
    assert image.frame_id == pose.frame_id == "top"
    assert image.timestamp.ToNanoseconds() == images[0][1]
    turn = pose.pose.orientation
    assert turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 == pytest.approx(1.0)
    assert len(found["/taxels"][1].counts) == 24
