"""Every format gives back what was written; LeRobot's own reader opens its folder; a robot's limits are respected."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tacdata import registry
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import BASE, ROOM, exporter
from tacdata.exporters.joints import in_words, read_joints
from tacdata.replay.inverse_kinematics import follow
from tacdata.replay.kinematics import Kinematics
from tacdata.replay.robot import read_robot
from tacdata.replay.targets import check_guesses, doubts, targets_of
from tacdata.sensor import default_sensor

GAINS = {"thumb": 0.004, "index": 0.010}
NETWORK = {"hash": "f" * 64, "network": "stand-in", "epoch": 1, "lookahead": 4, "sensor": "0"}


def demonstration(rows=40, network=NETWORK, number=0):
    rng = np.random.default_rng(number)
    seconds = np.arange(rows) / 30
    tracks = {}
    for k, name in enumerate(("thumb", "index")):
        turns = Rotation.from_rotvec(0.3 * np.sin(seconds[:, None] * (1, 2, 3) + k)).as_quat()
        place = 0.05 * np.stack([np.sin(seconds + k), np.cos(seconds), 0.5 * seconds], axis=1) + (0.1 * k, 0, 0.2)
        depth = np.clip(np.sin(seconds * 3), 0, None)[:, None, None] * rng.uniform(0.2, 1.0, (rows, 35, 26))
        gap = np.zeros(rows, bool)
        gap[10:14] = k == 1
        depth[20:21] = np.nan
        place[:2] = turns[:2] = np.nan  # not yet seen
        tracks[name] = FingerTrack(
            name,
            "right",
            name,
            place,
            turns,
            np.tile(np.eye(6) * 1e-8, (rows, 1, 1)),
            gap,
            rows,
            0,
            rng.normal(0, 100, (rows, 24)).astype(np.float32),
            depth.astype(np.float32) if network else None,
            np.linspace(0, 2, rows, dtype=np.float32) if network else None,
        )
    time_ns = 1_700_000_000_000_000_000 + np.rint(seconds * 1e9).astype(np.int64)
    name = f"episode-{number:06d}.mcap"
    sensors = dict.fromkeys(tracks, default_sensor())
    return Demonstration(name, "e" * 64, "grasp", "table", 30.0, time_ns, tracks, sensors, network=network)


# As some published URDFs hold them.
IMPOSSIBLE = '<inertial><mass value="1"/><inertia ixx="-1" iyy="1" izz="9" ixy="0" ixz="0" iyz="0"/></inertial>'


def fingers_urdf(velocity=5.0, reach=0.5, mimic=""):
    """Two fingers, each of three slides and three hinges on one base."""
    parts = ['<link name="base"/>']
    for finger in ("thumb", "index"):
        parent = "base"
        axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "yaw": "0 0 1", "pitch": "0 1 0", "roll": "1 0 0"}
        for name, axis in axes.items():
            kind, end = ("prismatic", reach) if len(name) == 1 else ("revolute", 3.0)
            extra = mimic if (finger, name) == ("index", "x") else ""
            parts.append(
                f'<link name="{finger}_{name}_link">{IMPOSSIBLE}<visual><geometry><mesh filename="package://no/where.stl"/>'
                f'</geometry></visual></link><joint name="{finger}_{name}" type="{kind}"><parent link="{parent}"/>'
                f'<child link="{finger}_{name}_link"/><axis xyz="{axis}"/>{extra}'
                f'<limit lower="{-end}" upper="{end}" effort="1" velocity="{velocity}"/></joint>'
            )
            parent = f"{finger}_{name}_link"
        parts.append(
            f'<link name="{finger}_tip"/><joint name="{finger}_end" type="fixed"><parent link="{parent}"/>'
            f'<child link="{finger}_tip"/><origin xyz="0 0 0.02"/></joint>'
        )
    return f'<robot name="two">{"".join(parts)}</robot>'


def robot(tmp_path, text=None, **more):
    (tmp_path / "two.urdf").write_text(text or fingers_urdf())
    document = {
        "version": "1.0",
        "name": "two",
        "urdf": "two.urdf",
        "base": {"position": [0.1, 0.0, 0.05], "quaternion": [0.0, 0.0, 0.3826834, 0.9238795]},
        "fingers": {"thumb": {"link": "thumb_tip"}, "index": {"link": "index_tip", "position": [0.0, 0.0, 0.01]}},
        "tolerance": {"position": 0.0001, "rotation": 0.001},
        **more,
    }
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


@pytest.mark.parametrize("name", registry.names(ROOM, BASE))
@pytest.mark.parametrize("gains", [None, GAINS])
def test_what_is_written_is_read_back(tmp_path, name, gains):
    episodes = [targets_of(demonstration(number=k), gains) for k in range(2)]
    out = tmp_path / "out"
    exporter(name, robot(tmp_path)).write(episodes, out)
    again = exporter(name, robot(tmp_path)).read(out)
    assert len(again) == 2
    for one, other in zip(episodes, again, strict=True):
        for field in ("position", "quaternion", "seen", "depth", "time_ns", "gap"):
            pair = getattr(one, field), getattr(other, field)
            assert np.array_equal(*pair, equal_nan=field == "depth"), field  # to the last bit
        for field in ("fingers", "kind", "gains", "frame", "rate", "task", "network", "recording", "remarks"):
            assert getattr(one, field) == getattr(other, field), field
    with pytest.raises(UsageError, match="exists"):
        exporter(name, robot(tmp_path)).write(episodes, out)
    with pytest.raises(UsageError):
        exporter(name, robot(tmp_path)).read(tmp_path / "nothing")


@pytest.mark.parametrize("name", ["csv", "parquet", "joints"])
def test_a_damaged_file_is_refused_in_words(tmp_path, name):
    out = tmp_path / "out"
    writer = exporter(name, robot(tmp_path))
    writer.write([targets_of(demonstration(), GAINS)], out)
    (path,) = out.glob("*.csv" if name == "csv" else "*.parquet")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(FormatError):
        writer.read(out)


def test_compensated_targets_move_along_the_pads_normals():
    made = demonstration()
    targets = targets_of(made, GAINS)
    assert len(targets.time_ns) == 38  # two rows before anything was seen
    for k, name in enumerate(targets.fingers):
        normal = Rotation.from_quat(targets.quaternion[:, k]).as_matrix()[:, :, 2]
        wanted = GAINS[name] * np.nan_to_num(targets.depth[:, k])[:, None] * normal
        assert np.allclose(targets.position[:, k] - targets.seen[:, k], wanted, atol=1e-12)
        assert np.nanmax(targets.depth[:, k]) > 0.9
    assert any("not moved at 1 of 38 times" in words for words in targets.remarks)
    assert np.array_equal(targets_of(made, None).position, targets.seen)
    far = targets_of(made, {"thumb": 0.004, "index": 0.1})
    assert any(words.startswith("index: moved by up to") and "0.1 m/mm meant?" in words for words in far.remarks)
    assert not any(words.startswith("thumb: moved") for words in far.remarks)


def test_what_cannot_be_made_is_refused():
    with pytest.raises(UsageError, match="without predicted depth"):
        targets_of(demonstration(network=None), GAINS)
    with pytest.raises(UsageError, match="no path for middle"):
        targets_of(demonstration(), None, ["middle"])
    with pytest.raises(UsageError, match="no gain for index"):
        targets_of(demonstration(), {"thumb": 0.1})
    with pytest.raises(UsageError, match="did you mean 'lerobot'"):
        exporter("lerobt")
    with pytest.raises(UsageError, match="without a robot"):
        exporter("joints")


def test_a_stretch_that_nobody_saw_is_said_and_refused_where_it_is_a_guess():
    made = demonstration()
    known = targets_of(made, None)
    check_guesses(known)  # a bridge that is known to 0.1 mm
    (words,) = doubts(known)
    assert (
        words.startswith("index: 4 of 38 targets bridge gaps") and "0.1 s from 0.3 s on" in words and "0.1 mm" in words
    )
    covariance = made.tracks["index"].covariance.copy()
    covariance[11:13, 3:, 3:] = 0.08**2 * np.eye(3)
    unsure = replace(made, tracks={**made.tracks, "index": replace(made.tracks["index"], covariance=covariance)})
    with pytest.raises(UsageError, match=r"index was not seen for 0.1 s.*up to 80 mm") as caught:
        check_guesses(targets_of(unsure, None))
    assert "--with-guesses" in str(caught.value)
    check_guesses(targets_of(unsure, None, ("thumb",)))
    with pytest.raises(UsageError, match="thumb is named twice"):
        targets_of(made, None, ("thumb", "index", "thumb"))


def test_lerobots_info_calls_predictions_predictions(tmp_path):
    out = tmp_path / "out"
    exporter("lerobot").write([targets_of(demonstration(), GAINS)], out)
    features = json.loads((out / "meta/info.json").read_text())["features"]
    maps = features["observation.predicted_depth.index"]
    assert maps["info"]["prediction"] is True and maps["info"]["checkpoint"] == NETWORK["hash"]
    novelty = features["tacdata.predicted_novelty.index"]["info"]
    assert novelty["checkpoint"] == NETWORK["hash"] and novelty["unit"] == "1"
    parts = ("x", "y", "z", "qx", "qy", "qz", "qw")
    assert features["action"]["names"] == [f"{finger}.{part}" for finger in ("thumb", "index") for part in parts]


def test_stock_lerobot_opens_the_folder(tmp_path):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    episodes = [targets_of(demonstration(number=k), GAINS) for k in range(2)]
    exporter("lerobot").write(episodes, tmp_path / "out")
    opened = LeRobotDataset("own/demo", root=tmp_path / "out")
    assert len(opened) == 76
    item = opened[40]
    wanted = np.concatenate([episodes[1].position[2], episodes[1].quaternion[2]], axis=-1).ravel()
    assert np.allclose(item["action"].numpy(), wanted, atol=1e-6)
    track = episodes[1].source.tracks["index"]
    assert float(item["tacdata.predicted_novelty.index"]) == pytest.approx(float(track.novelty[4]))
    maps = track.depth[4]
    assert np.allclose(item["observation.predicted_depth.index"].numpy()[0], maps, atol=1e-6)  # mm


def test_joint_values_bring_the_fingertips_to_their_targets(tmp_path):
    targets = targets_of(demonstration(), GAINS)
    described = read_robot(robot(tmp_path))
    path, model = follow(described, targets)
    assert not path.unreached and not path.too_fast and np.isfinite(path.values).all()
    assert [joint.name for joint in path.joints][:2] == ["thumb_x", "thumb_y"] and path.joints[3].unit == "rad"
    for row in (0, 17, 37):
        places, turns = model.tips(path.values[row])
        assert np.abs(places - targets.position[row]).max() < 1e-4
        wanted = Rotation.from_quat(targets.quaternion[row]).as_matrix()
        assert np.abs(turns - wanted).max() < 1e-3


def test_targets_out_of_reach_are_named_and_never_clipped(tmp_path):
    targets = targets_of(demonstration(), GAINS)
    writer = exporter("joints", robot(tmp_path, fingers_urdf(reach=0.1)))
    said = writer.write([targets], tmp_path / "out")
    assert any("index does not reach" in words for words in said)
    ((_, values, header),) = read_joints(tmp_path / "out")
    rows = header["unreached"]["index"]
    assert rows and np.isnan([values["thumb_x"][k] for k in rows]).all()
    reached = np.setdiff1d(np.arange(38), [k for rows in header["unreached"].values() for k in rows])
    assert np.isfinite(values["thumb_x"][reached]).all()
    assert max(np.abs(values["index_x"][reached]), default=0) <= 0.1 + 1e-9


def hinge(name, parent, child, x=0.0, axis="0 0 1", velocity=10):
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>'
        f'<axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="1" velocity="{velocity}"/></joint>'
    )


ARM = (
    '<robot name="arm">'
    + "".join(f'<link name="{name}"/>' for name in ("base", "upper", "lower", "tip", "leg"))
    + hinge("shoulder", "base", "upper")
    + hinge("elbow", "upper", "lower", 0.2)
    + hinge("knee", "base", "leg", axis="0 1 0", velocity=1)
    + '<joint name="wrist" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.2 0 0"/></joint>'
    + "</robot>"
)


def arm(tmp_path, **more):
    fingers = {"index": {"link": "tip"}}
    return read_robot(robot(tmp_path, ARM, base={**HOME}, fingers=fingers, orientation_weight=0, **more))


HOME = {"position": [0.0, 0.0, 0.0], "quaternion": [0.0, 0.0, 0.0, 1.0]}


def test_what_lies_out_of_reach_is_off_by_its_distance_and_what_follows_is_reached(tmp_path):
    # A straight arm of 0.4 m; the path leaves its disc by 0.1 m and comes back.
    seconds = np.arange(60) / 30
    away = 0.3 + 0.2 * np.sin(np.pi * seconds / 2) ** 2
    places = np.stack([away * np.cos(0.4 * seconds), away * np.sin(0.4 * seconds), 0 * seconds], axis=1)
    made = demonstration(rows=60)
    track = replace(made.tracks["index"], position=places, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (60, 1)))
    targets = targets_of(replace(made, tracks={"index": track}), None)
    path, _ = follow(arm(tmp_path, home={"elbow": 0.5}, tolerance={"position": 1e-4}), targets)
    far, knee = away > 0.4 + 1e-4, [joint.name for joint in path.joints].index("knee")
    assert 10 < far.sum() < 50 and path.unreached == {"index": tuple(np.flatnonzero(far))}
    beyond = path.position_error[far, 0] - (away[far] - 0.4)
    assert beyond.min() > -1e-6 and beyond.max() < 0.001  # at a straight arm the last millimetre takes many steps
    assert not path.too_fast.get("knee") and np.ptp(path.values[~far, knee]) == 0
    assert np.isfinite(path.values[~far]).all() and path.values.shape == (60, 3)
    with pytest.raises(FormatError, match="home of joint elbow"):
        follow(arm(tmp_path, home={"elbow": 3.0}), targets)


def test_a_joint_whose_limits_are_equal_does_not_move(tmp_path):
    stiff = ARM.replace('lower="-2.5" upper="2.5" effort="1" velocity="10"/></joint><joint name="elbow"', LOCKED, 1)
    made = demonstration(rows=3)
    places = np.array([[0.4, 0.0, 0.0], [0.3, 0.1, 0.0], [0.0, 0.4, 0.0]])
    track = replace(made.tracks["index"], position=places, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)))
    (tmp_path / "locked").mkdir()
    fingers = {"index": {"link": "tip"}}
    described = read_robot(robot(tmp_path / "locked", stiff, base={**HOME}, fingers=fingers, orientation_weight=0))
    path, _ = follow(described, targets_of(replace(made, tracks={"index": track}), None))
    shoulder = [joint.name for joint in path.joints].index("shoulder")
    assert 2 in path.unreached["index"] and 0 not in path.unreached["index"]
    assert abs(path.values[0, shoulder]) < 1e-5


LOCKED = 'lower="0" upper="0" effort="1" velocity="10"/></joint><joint name="elbow"'


def test_workspace_and_velocity_limits_are_checked(tmp_path):
    targets = targets_of(demonstration(), GAINS)
    slow = read_robot(robot(tmp_path, fingers_urdf(velocity=0.04)))
    path, _ = follow(slow, targets)
    speed = np.abs(np.diff(path.values, axis=0)) * 30
    for k, joint in enumerate(path.joints):
        assert joint.velocity == 0.04
        assert set(path.too_fast.get(joint.name, ())) == set(1 + np.flatnonzero(speed[:, k] > 0.04 * (1 + 1e-6)))
    assert path.too_fast
    small = read_robot(robot(tmp_path, workspace={"min": [-1, -1, -1], "max": [1, 1, 0.16]}))
    path, _ = follow(small, targets)
    high = targets.position[:, 0, 2] - 0.05 > 0.16
    assert high.any() and path.outside_workspace["thumb"] == tuple(np.flatnonzero(high))
    assert np.isnan(path.values[high]).all() and np.isfinite(path.values[~high]).any()


def test_a_mimic_joint_follows_or_the_target_is_not_reached(tmp_path):
    targets = targets_of(demonstration(rows=6), GAINS)
    tied = fingers_urdf(mimic='<mimic joint="thumb_x" multiplier="1.0" offset="0.0"/>')
    path, model = follow(read_robot(robot(tmp_path, tied)), targets)
    assert model.model.neq == 1
    # Both cannot have the same x in the base's frame: some target is missed, or the coupling is broken, and is named.
    assert path.unreached or path.uncoupled
    assert np.isfinite(path.position_error).all() and path.mimics == ("index_x",)
    said = in_words(path, targets)
    assert said and not any("inf" in words for words in said)
    if path.uncoupled:
        assert any("mimic joints (index_x)" in words for words in said)


SPIN = ARM.replace('type="revolute"', 'type="continuous"', 2).replace('lower="-2.5" upper="2.5" ', "", 2)


def circling(tmp_path, urdf, seconds, places, **more):
    fingers = {"index": {"link": "tip"}}
    more |= {"base": HOME, "fingers": fingers, "orientation_weight": 0, "tolerance": {"position": 0.001}}
    described = read_robot(robot(tmp_path, urdf, **more))
    made = demonstration(rows=len(seconds))
    track = replace(
        made.tracks["index"],
        position=places,
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(seconds), 1)),
        gap=np.zeros(len(seconds), bool),
    )
    return follow(described, targets_of(replace(made, tracks={"index": track}), None))[0]


def test_a_joint_without_limits_stays_at_the_nearest_turn(tmp_path):
    """Once around the base and back: the joint goes with it, and never stands a turn away."""
    seconds = np.arange(120) / 30
    angle = 2 * np.pi * np.sin(np.pi * seconds / 4) ** 2
    places = 0.3 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    path = circling(tmp_path, SPIN, seconds, places, home={"shoulder": 0.0, "elbow": 1.0})
    assert not path.unreached and not path.other_posture
    assert np.abs(path.values[0]).max() < np.pi
    steps = np.abs(np.diff(path.values, axis=0))
    assert steps.max() < 0.2
    assert np.ptp(path.values[:, 0]) == pytest.approx(2 * np.pi, abs=0.05)


def arc(angle):
    return 0.25 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def test_one_posture_that_serves_the_whole_path_is_taken(tmp_path):
    """Solved row by row the shoulder meets its limit of 2.5 rad in the ninth row, and the elbow flips over."""
    seconds = np.arange(150) / 30
    places = arc(1.6 + 0.42 * np.sin(np.pi * seconds / 5) ** 2)
    path = circling(tmp_path, ARM, seconds, places, home={"shoulder": 2.3, "elbow": -1.0})
    assert np.isfinite(path.values).all()
    assert np.abs(np.diff(path.values, axis=0)).max() < 0.05


def test_rows_that_only_another_posture_reaches_are_left_out_and_named(tmp_path):
    """Either posture of the elbow meets the shoulder's limit at one end of the arc: no chain serves both ends."""
    seconds = np.arange(150) / 30
    angle = -1.9 * np.cos(np.pi * seconds / 5)
    path = circling(tmp_path, ARM, seconds, arc(angle), home={"shoulder": -1.0, "elbow": -1.0})
    served, bend = np.isfinite(path.values).all(axis=1), np.arccos(0.125 / 0.2)
    assert abs(served.sum() - (angle < 2.5 - bend).sum()) <= 1
    assert np.abs(np.diff(path.values[served], axis=0)).max() < 0.1
    assert path.other_posture == tuple(np.flatnonzero(~served)) and not path.unreached
    assert len(path.other_posture) > 20


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_a_urdf_is_read_in_the_encoding_that_it_names(tmp_path, encoding):
    path = robot(tmp_path)
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + fingers_urdf().replace('name="two"', 'name="Fühler"')
    (tmp_path / "two.urdf").write_bytes(text.encode(encoding))
    assert "Fühler" in read_robot(path).urdf
    (tmp_path / "two.urdf").write_bytes(text.replace(encoding, "utf-8").encode("iso-8859-1"))
    with pytest.raises(FormatError, match="not in the encoding that it names"):
        read_robot(path)


def test_a_robot_file_is_checked(tmp_path):
    for more, words in (
        ({"fingers": {"thumb": {"link": "no_tip"}}}, "link no_tip"),
        ({"home": {"elbow": 1.0}}, "joint elbow"),
        ({"urdf": "none.urdf"}, "no URDF"),
        ({"workspace": {"min": [0, 0, 0], "max": [1, 0, 1]}}, "min below max"),
    ):
        with pytest.raises((FormatError, UsageError), match=words):
            read_robot(robot(tmp_path, **more))
    path = robot(tmp_path)
    (tmp_path / "two.urdf").write_text("<robot><link")
    with pytest.raises(FormatError, match="no XML"):
        read_robot(path)
    with pytest.raises(UsageError, match="no fingertip for middle"):
        Kinematics(read_robot(robot(tmp_path)), ("middle",))


@pytest.mark.parametrize("change", [('velocity="5.0"', 'velocity="fast"'), ('lower="-0.5"', 'lower="here"')])
def test_a_limit_that_is_no_number_is_refused(tmp_path, change):
    with pytest.raises(FormatError, match="numbers as limits"):
        read_robot(robot(tmp_path, fingers_urdf().replace(*change, 1)))
