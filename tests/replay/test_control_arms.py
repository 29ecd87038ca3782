"""What touch was worth: control arms share the mean displacement, differences are paired, feedback presses as felt."""

from dataclasses import replace

import numpy as np
import pytest
from test_scene import grasp

from tacdata.replay.comparison.arms import CLOSE, CLOSING, CONSTANT, TAXELS, control_arms
from tacdata.replay.comparison.challenges import CHALLENGES, changed
from tacdata.replay.comparison.depth_feedback import BANDWIDTH, UNLIKE, DepthFeedback, squeezing
from tacdata.replay.comparison.paired import paired, worth
from tacdata.replay.comparison.trials import like_published, rate
from tacdata.replay.grasp import touched
from tacdata.replay.scene import ReplayScene, drawn


def shifts(path, direct):
    """Displacements along the pads' normals [m], shape (n, f)."""
    return ((path.position - direct.position) * direct.normals).sum(axis=-1)


def test_control_arms_move_as_far_as_depth_does_and_know_less():
    (direct, _), (moved, _) = grasp(), grasp(0.005)
    direct = replace(direct, readings=direct.depth * np.array([900.0, 1100.0, 1000.0]))
    arms = control_arms(direct, moved)
    _, touch = touched(direct)
    mean = shifts(moved, direct)[touch].mean()
    for name in (CONSTANT, TAXELS):
        assert shifts(arms[name], direct)[touch].mean() == pytest.approx(mean)
    assert np.ptp(shifts(arms[CONSTANT], direct)[touch]) < 1e-12 < np.ptp(shifts(moved, direct)[touch])
    assert shifts(arms[CLOSE], direct)[touch] == pytest.approx(CLOSING)
    assert not shifts(arms[CONSTANT], direct)[~touch].any()


@pytest.mark.parametrize(
    ("first", "second", "value", "words"),
    [
        ([True] * 20, [False] * 20, 1.0, "depth was worth that much"),
        ([True, False] * 10, [True, False] * 10, 0.0, "depth was worth nothing that these scenes show"),
        ([False] * 20, [True] * 20, -1.0, "depth did worse"),
        ([True] * 11 + [False] * 9, [True] * 9 + [False] * 11, 0.1, "worth nothing"),
    ],
)
def test_differences_are_paired_and_end_in_a_sentence(first, second, value, words):
    difference = paired(first, second)
    low, high = difference.interval
    assert difference.value == pytest.approx(value) and low <= value <= high
    assert words in worth(first, {"constant": second, "close 1 mm": [False] * 20})


def test_a_row_like_the_papers_is_marked():
    def row(direct, depth):
        return {
            "rates": {
                "direct": rate([True] * direct + [False] * (20 - direct)),
                "compensated": rate([True] * depth + [False] * (20 - depth)),
            }
        }

    assert like_published(row(0, 18), "grasp") and not like_published(row(10, 18), "grasp")
    assert not like_published(row(0, 10), "grasp") and not like_published(row(0, 18), "pour")


def test_feedback_presses_as_deep_as_the_person_did():
    """A skin on a soft robot, which gives way by a tenth of a target's displacement."""
    seconds, softness = np.arange(0, 6, 0.05), 11.0
    goal = np.where((seconds > 0.5) & (seconds < 4.5), 0.001, 0.0)[:, None]
    controller = DepthFeedback(goal, seconds, np.tile([0.0, 0.0, 1.0], (len(seconds), 1, 1)), softness, 1)
    controller._shallow[:] = 0.0002
    depth, step, found = np.zeros(1), 0.005, []
    for moment in np.arange(0, 6, step):
        shift = controller.shift(float(moment), depth, step)
        depth = np.maximum(shift[:, 2] / softness, 0.0)
        found.append(depth[0])
    found = np.array(found)
    # An estimate that is 0.2 mm too shallow makes it press 0.2 mm deeper.
    assert found[int(4.0 / step)] == pytest.approx(0.0012, abs=0.0001) and found[: int(0.5 / step)].max() == 0
    assert found.max() < 0.0016 and found[-1] < 1e-4
    assert BANDWIDTH * 0.13 < 0.5  # rad of phase that the latency takes


def test_feedback_of_readings_is_off_by_the_gain_of_the_unit():
    """Pressed until a unit reads as the usual one would, the skin is as deep as that unit's gain is small."""
    seconds, softness = np.arange(0, 4, 0.05), 11.0
    goal = np.where(seconds > 0.5, 0.001, 0.0)[:, None]
    controller = DepthFeedback(goal, seconds, np.tile([0.0, 0.0, 1.0], (len(seconds), 1, 1)), softness, 1, raw=True)
    assert abs(controller._gain - 1.0).max() < UNLIKE
    controller._gain[:] = 0.8
    depth, step = np.zeros(1), 0.005
    for moment in np.arange(0, 4, step):
        depth = np.maximum(controller.shift(float(moment), depth, step)[:, 2] / softness, 0.0)
    assert depth[0] == pytest.approx(0.001 / 0.8, abs=0.0001)


def test_fingers_that_disagree_do_not_carry_the_object_away():
    """Two opposed fingers, whose forces balance: their depths are equal, whatever each of them estimates."""
    seconds, softness, step = np.arange(0, 6, 0.05), 11.0, 0.005
    outward = np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (len(seconds), 1, 1))
    controller = DepthFeedback(np.full((len(seconds), 2), 0.001), seconds, outward, softness, 1)
    controller._shallow[:] = 0.0, 0.0002
    depth, carried = np.zeros(2), []
    for moment in np.arange(0, 6, step):
        shift = controller.shift(float(moment), depth, step)[:, 0]
        depth[:] = max((shift[0] - shift[1]) / 2 / softness, 0.0)
        carried.append(shift.sum() / 2)
    # Each for itself they would carry it by 3 mm/s.
    assert np.abs(carried).max() < 0.0005
    assert depth == pytest.approx(0.0011, abs=0.00005)


def test_velocities_that_squeeze_are_kept():
    angles = np.radians([0, 120, 240])
    around = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    assert squeezing(np.ones(3), around) == pytest.approx(np.ones(3))
    assert squeezing(around @ [0.3, -0.2, 0.0], around) == pytest.approx(np.zeros(3))
    thumb_and_two = np.array([[1.0, 0, 0], [-1.0, 0, 0], [-1.0, 0, 0]])
    assert squeezing(np.array([2.0, 1.0, 1.0]), thumb_and_two) == pytest.approx([2.0, 1.0, 1.0])
    # Two on one side press against a table.
    assert squeezing(np.array([1.0, 2.0]), thumb_and_two[1:]) == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("name", CHALLENGES)
def test_challenges_change_what_they_name(name):
    scene = drawn(ReplayScene(), 3, 0)
    other = changed(name, scene, 0)
    assert (other == scene) is (name in ("as demonstrated", "fragile"))
    assert changed(name, scene, 0) == other
    if "shifted" in name:
        assert np.linalg.norm(np.subtract(other.place, scene.place)) == pytest.approx(0.003)
