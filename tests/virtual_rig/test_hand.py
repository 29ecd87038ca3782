"""The emulated hand: it holds what it holds from opposite sides, and lifts it or wipes with it."""

import numpy as np
import pytest

from tacdata.virtual_rig.world.hand import DIRECTIONS, LIFT, STROKE, TASKS, THINGS, TIMES, draw_hand

MOMENTS = np.arange(TIMES[2], TIMES[5], 0.02)


def paths(task):
    hand = draw_hand(2, task)
    return hand, {name: np.array([hand.tip(name, t) for t in MOMENTS]) for name in DIRECTIONS}


@pytest.mark.parametrize("task", TASKS)
def test_every_finger_presses_the_object_it_holds(task):
    hand, found = paths(task)
    assert hand.task == hand.document["task"] == task
    middle = np.mean([found["thumb"], (found["index"] + found["middle"]) / 2], axis=0)[:, :3, 3]
    for name, poses in found.items():
        toward = middle - poses[:, :3, 3]
        toward /= np.linalg.norm(toward, axis=1)[:, None]
        assert np.einsum("ij,ij->i", toward, poses[:, :3, 2]).min() > 0.8
        assert hand.press(name, 4.0)[2] == pytest.approx(hand.depth[name])
        assert hand.press(name, 0.5)[2] == 0


def test_a_wipe_goes_to_and_fro_twice_and_a_grasp_goes_up():
    _, wiped = paths("wipe")
    along = 1000 * np.mean([poses[:, 1, 3] for poses in wiped.values()], axis=0)
    assert along.max() == pytest.approx(STROKE, abs=2) and along.min() == pytest.approx(-STROKE, abs=2)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(along[np.abs(along) > 2]))))
    assert len(turns) == 4
    apart = 1000 * (wiped["index"][:, 0, 3] - wiped["thumb"][:, 0, 3])
    assert np.abs(apart - 2 * THINGS["eraser"]).max() < 4  # less both depths, and what the hand trembles
    assert max(np.ptp(1000 * poses[:, 2, 3]) for poses in wiped.values()) < 3
    _, lifted = paths("grasp")
    assert np.ptp(1000 * lifted["thumb"][:, 2, 3]) == pytest.approx(LIFT, abs=8)


@pytest.mark.parametrize(("thing", "half"), [("ball", 35.0), ("can", 33.0), ("box", 30.0)])
def test_an_object_is_held_at_its_own_width(thing, half):
    hand = draw_hand(2, "grasp", thing)
    tips = {name: 1000 * hand.tip(name, 4.0)[:3, 3] for name in DIRECTIONS}
    normals = {name: hand.tip(name, 4.0)[:3, 2] for name in DIRECTIONS}
    # From where each finger touches, half the width along its normal leads to the object's middle.
    middles = np.array([tips[name] + (half - hand.depth[name]) * normals[name] for name in DIRECTIONS])
    if thing == "box":
        assert np.ptp(middles[:, 1]) == pytest.approx(28.0, abs=3.0)
        middles = middles[:, [0, 2]]
    assert np.ptp(middles, axis=0).max() < 3.0
