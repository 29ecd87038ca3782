"""A replay through joints: springs, limits and efforts of the joints decide how hard the pads press."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.compensation import read_gains
from tacdata.errors import UsageError
from tacdata.replay.comparison.linked_hand import LinkedHand
from tacdata.replay.grasp import cut, felt_place, first_grasp
from tacdata.replay.outcome import replay_targets
from tacdata.replay.robot import read_robot
from tacdata.replay.scene import scene_of
from tacdata.replay.targets import FingertipTargets
from tacdata.virtual_rig.world.hand import draw_hand

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "two_finger_hand"
FINGERS, RATE, SCENE = ("thumb", "index"), 30.0, scene_of("grasp", "box")
ALPHA = read_gains().of("grasp")["index"]
FIRM = 2 * ALPHA
"""A gain that leaves room [m/mm]."""


def grasp(gain=0.0):
    """Thumb and index of a hand that grasps a box, as a perfect tracker and network would give them."""
    hand, times = draw_hand(1, "grasp", "box"), np.arange(int(8.4 * RATE)) / RATE
    poses = np.array([[hand.tip(name, t) for name in FINGERS] for t in times])
    depth = np.array([[hand.press(name, t)[2] for name in FINGERS] for t in times])
    turns = Rotation.from_matrix(poses[..., :3, :3].reshape(-1, 3, 3)).as_quat().reshape(*poses.shape[:2], 4)
    moved = poses[..., :3, 3] + gain * depth[..., None] * poses[..., :3, 2]
    stamps = np.rint(times * 1e9).astype(np.int64)
    whole = FingertipTargets(
        *("x.mcap", "0", "grasp", "table", RATE, FINGERS, "direct", {}, stamps),
        *(moved, turns, poses[..., :3, 3], depth, np.zeros(depth.shape, bool)),
        readings=2400.0 * depth,
    )
    begin, touch, end = first_grasp(whole)
    return cut(whole, begin, end), felt_place(whole, touch, SCENE.reach).centre


def robot(folder, urdf=str, **entries):
    """The example's hand with another URDF text or entries of its robot file."""
    document = yaml.safe_load((EXAMPLE / "robot.yaml").read_text())
    (folder / "hand.urdf").write_text(urdf((EXAMPLE / "hand.urdf").read_text()))
    (folder / "robot.yaml").write_text(yaml.safe_dump(document | entries))
    return read_robot(folder / "robot.yaml")


def held(hand, gain, scene=SCENE):
    targets, centre = grasp(gain)
    return replay_targets(targets, scene, centre, hand=LinkedHand(hand, targets, SCENE))


def test_joints_lose_a_box_directly_and_hold_it_compensated():
    hand = read_robot(EXAMPLE / "robot.yaml")
    lost, kept = held(hand, 0.0), held(hand, ALPHA)
    assert not lost.held and kept.held and kept.lift > 0.07
    assert kept.force["thumb"] == pytest.approx(kept.force["index"], rel=0.05)
    for name in FINGERS:
        assert kept.force[name] / (kept.depth[name] / 1000) == pytest.approx(SCENE.skin, rel=0.05)


def test_softer_joints_press_less(tmp_path):
    hand = read_robot(EXAMPLE / "robot.yaml")
    soft = robot(tmp_path, stiffness={n: v if v > 10 else v / 2 for n, v in hand.stiffness.items()})
    usual, halved = (LinkedHand(r, grasp(ALPHA)[0], SCENE).stiffness for r in (hand, soft))
    assert usual == pytest.approx(342, rel=0.05) and usual / halved == pytest.approx(2.0, rel=0.05)
    stiff, yielding = (held(r, FIRM).force["thumb"] for r in (hand, soft))
    assert 1.4 < stiff / yielding < 2.2
    # A scene with softer springs has softer joints.
    drawn = held(hand, FIRM, replace(SCENE, stiffness=SCENE.stiffness / 2))
    assert drawn.force["thumb"] == pytest.approx(yielding, rel=0.02)


def test_a_motor_presses_no_harder_than_its_effort(tmp_path):
    """0.05 N m at a lever of 0.11 m."""
    weak = robot(tmp_path, urdf=lambda text: text.replace('effort="3"', 'effort="0.05"'))
    outcome = held(weak, ALPHA)
    assert not outcome.held and outcome.hardest < 0.05 / 0.05 < held(read_robot(EXAMPLE / "robot.yaml"), ALPHA).hardest


def test_a_displacement_moves_the_pads_by_as_much():
    targets, centre = grasp()
    away = np.array([[0.002, -0.001, 0.003], [-0.002, 0.001, 0.001]])
    far = centre + np.array([0.0, 0.5, 0.0])
    hand = read_robot(EXAMPLE / "robot.yaml")
    still, moved = (
        replay_targets(targets, scene, far, hand=LinkedHand(hand, targets, SCENE)).path.tips
        for scene in (SCENE, replace(SCENE, bias=tuple(map(tuple, away.tolist()))))
    )
    assert (moved - still)[20:] == pytest.approx(np.tile(away, (len(still) - 20, 1, 1)), abs=2e-4)


def test_a_joint_that_follows_another_needs_no_stiffness(tmp_path):
    """The index swings as the thumb does, mirrored."""
    mimic = '<mimic joint="thumb_swing" multiplier="-1"/></joint>'

    def coupled(text):
        head, name, tail = text.partition('<joint name="index_swing"')
        return head + name + tail.replace("</joint>", mimic, 1)

    stiffness = read_robot(EXAMPLE / "robot.yaml").stiffness
    hand = robot(tmp_path, coupled, stiffness={n: v for n, v in stiffness.items() if n != "index_swing"})
    outcome = held(hand, FIRM)
    assert outcome.held and outcome.force["thumb"] == pytest.approx(outcome.force["index"], rel=0.1)


def test_what_a_robot_cannot_follow_is_refused(tmp_path):
    targets, _ = grasp()
    bare = robot(tmp_path, stiffness={"yaw": 500.0})
    with pytest.raises(UsageError, match="states no stiffness of slide_x, slide_y, slide_z, pitch, roll, thumb_twist"):
        LinkedHand(bare, targets, SCENE)
    away = robot(tmp_path, base={"position": [1.5, 0, 0.15], "quaternion": [0, 0, 0, 1]})
    with pytest.raises(UsageError, match=r"does not follow \d+ of \d+ targets"):
        LinkedHand(away, targets, SCENE)


def test_a_replay_holds_the_links_and_the_shapes_of_the_pads():
    hand = read_robot(EXAMPLE / "robot.yaml")
    path = held(hand, ALPHA).path
    # From each joint to the next, then to each pad.
    assert path.links[:, -2:, 1] == pytest.approx(path.tips)
    lengths = np.linalg.norm(np.diff(path.links, axis=2)[:, :, 0], axis=-1)
    assert np.ptp(lengths[:, -2:], axis=0).max() < 1e-6 < lengths[:, -2:].min()
    for k, name in enumerate(FINGERS):
        assert np.sqrt(np.linalg.eigvalsh(path.pads[0, k])) == pytest.approx(sorted(hand.pads[name]))
    targets, centre = grasp(ALPHA)
    assert replay_targets(targets, SCENE, centre).path.links.shape[1] == 0
