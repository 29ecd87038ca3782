"""A grasp in simulation: lost without compensation, held with it, and neither is decided by us."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.compensation import read_gains
from tacdata.errors import UsageError
from tacdata.replay.grasp import cut, felt_place, first_grasp, touching
from tacdata.replay.outcome import replay_targets
from tacdata.replay.scene import OBJECTS, ReplayObject, ReplayScene, drawn, scene_of
from tacdata.replay.targets import FingertipTargets
from tacdata.virtual_rig.world.hand import DIRECTIONS, HEIGHT, RADIUS, draw_hand

HAND, RATE = draw_hand(1), 30.0


def targets(gain=0.0, begin=0.0, seconds=8.4):
    """The hand's own path and depth, as a perfect tracker and network would give them."""
    times = begin + np.arange(int(seconds * RATE)) / RATE
    poses = np.array([[HAND.tip(name, t) for name in DIRECTIONS] for t in times])
    depth = np.array([[HAND.press(name, t)[2] for name in DIRECTIONS] for t in times])
    turns = Rotation.from_matrix(poses[..., :3, :3].reshape(-1, 3, 3)).as_quat().reshape(*poses.shape[:2], 4)
    moved = poses[..., :3, 3] + gain * depth[..., None] * poses[..., :3, 2]
    gains = dict.fromkeys(DIRECTIONS, gain) if gain else {}
    return FingertipTargets(
        "x.mcap",
        "0",
        "grasp",
        "table",
        RATE,
        tuple(DIRECTIONS),
        "compensated" if gain else "direct",
        gains,
        np.rint(times * 1e9).astype(np.int64),
        moved,
        turns,
        poses[..., :3, 3],
        depth,
        np.zeros(depth.shape, bool),
        readings=2400.0 * depth,
    )


def grasp(gain=0.0):
    whole = targets(gain)
    begin, touch, end = first_grasp(whole)
    return cut(whole, begin, end), felt_place(whole, touch, RADIUS / 1000).centre


def test_the_ball_is_found_where_the_hand_held_it():
    _, centre = grasp()
    assert np.linalg.norm(centre - (0, 0, HEIGHT / 1000)) < 0.007  # the hand sways by some millimetres


def test_direct_replay_loses_the_ball_and_compensated_replay_holds_it():
    direct, centre = grasp()
    alpha = read_gains().of("grasp")["index"]
    compensated, _ = grasp(alpha)
    lost, held = (replay_targets(path, ReplayScene(), centre) for path in (direct, compensated))
    assert not lost.held and lost.lift < 0.005
    assert held.held and held.lift > 0.07
    # The thumb presses against the two others; each skin gives way as its stiffness says.
    across = DIRECTIONS["index"][0] / np.linalg.norm(DIRECTIONS["index"])
    assert held.force["thumb"] == pytest.approx(across * (held.force["index"] + held.force["middle"]), rel=0.1)
    for name in DIRECTIONS:
        assert held.force[name] / (held.depth[name] / 1000) == pytest.approx(ReplayScene().skin, rel=0.1)


def test_physics_decides():
    """The same compensated path loses a ball that is heavy or slippery, and holds more with stiffer springs."""
    compensated, centre = grasp(0.005)
    for worse in ({"mass": 0.9}, {"friction": 0.1}):
        assert not replay_targets(compensated, replace(ReplayScene(), **worse), centre).held
    soft, stiff = (replay_targets(compensated, ReplayScene(stiffness=k), centre).force["thumb"] for k in (300.0, 600.0))
    assert 1.4 < stiff / soft < 2.2


def test_the_verdict_says_why_and_when():
    direct, centre = grasp()
    lost, held = (replay_targets(path, ReplayScene(), centre) for path in (direct, grasp(0.01)[0]))
    # Friction carries less than the weight: the fingers leave the ball behind as they rise.
    assert lost.grip < 0.5 and lost.reason.startswith("lost at") and "it weighs 1.8 N" in lost.reason
    rising = np.flatnonzero(direct.seen[..., 2].mean(axis=1) > direct.seen[..., 2].mean(axis=1).min() + 0.015)[0]
    assert lost.decided == pytest.approx(rising / RATE, abs=0.2)
    assert held.grip > 1.5 and held.slip < 0.003 and held.reason.startswith("held: friction")
    assert held.grip == pytest.approx(0.8 * sum(held.force.values()) / (0.18 * 9.81), rel=0.15)
    assert held.decided > lost.decided + 1.0  # a lift is held only once it has ended


def test_pads_slide_along_a_face_that_stays_as_far_as_they_rise():
    compensated, centre = grasp(0.01)
    wall = ReplayScene(name="box", body=ReplayObject("box", (0.035, 0.1, 0.3), 9.0), mass=9.0, friction=0.1)
    lost = replay_targets(compensated, wall, centre)
    assert not lost.held and 0.015 < lost.behind < 0.02 and lost.slip == pytest.approx(lost.behind, abs=0.002)
    rising = slice(42, 55)
    rise, slid = (np.diff(path[rising][[0, -1]], axis=0)[0] for path in (lost.path.tips, lost.path.slid))
    assert rise[:, 2].min() > 0.03 and slid[:, 2] == pytest.approx(-rise[:, 2], abs=0.001)


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_rests_until_it_is_touched(name):
    scene = scene_of("wipe" if name == "eraser" else "grasp", name)
    direct, _ = grasp()
    centre = np.array([0.0, 0.0, scene.body.height])
    path = replay_targets(
        replace(direct, position=direct.position + np.array([0.0, 0.3, 0.2])), replace(scene, task="grasp"), centre
    )
    assert np.ptp(path.path.centre, axis=0).max() < 1e-4 and not path.path.force.any()


def test_a_seed_draws_the_same_scene_again_and_another_seed_another():
    assert drawn(ReplayScene(), 3, 4) == drawn(ReplayScene(), 3, 4) != drawn(ReplayScene(), 3, 5)
    first, again = (replay_targets(grasp(0.005)[0], drawn(ReplayScene(), 3, 1), grasp()[1]) for _ in range(2))
    assert np.array_equal(first.path.centre, again.path.centre)


def test_a_recording_that_begins_in_the_middle_of_a_grasp_gives_the_next_one():
    whole = targets(begin=4.0, seconds=13.0)
    assert touching(whole)[0]
    begin, touch, end = first_grasp(whole)
    seconds = 4.0 + np.array([begin, touch, end]) / RATE
    assert 8.5 + 2.0 - 1.1 < seconds[0] < seconds[1] < 8.5 + 2.6 and seconds[2] > 8.5 + 6.8


def test_what_is_no_grasp_is_refused():
    never = targets()
    with pytest.raises(UsageError, match="open fingers"):
        first_grasp(replace(never, readings=np.full_like(never.depth, np.nan)))
    with pytest.raises(UsageError, match="no readings of all of thumb, index, middle"):
        first_grasp(replace(never, readings=None))
    flat = targets(seconds=2.4)
    with pytest.raises(UsageError, match="rise by"):
        rows = np.zeros(len(flat.position), int)
        still = replace(flat, position=flat.position[rows], quaternion=flat.quaternion[rows])
        replay_targets(still, ReplayScene(), np.zeros(3))
