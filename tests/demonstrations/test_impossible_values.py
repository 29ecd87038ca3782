"""Poses that are no poses cost one image, and rig files in another unit are refused with the figure."""

import copy

import numpy as np
import pytest
from demo_examples import FINGERS, INTRINSICS, changed, rig, truth_at, view

from tacdata.demonstrations.paths.acquisition import acquire
from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.sightings import sightings_of
from tacdata.demonstrations.recording.rig import demo_rig_of
from tacdata.errors import FormatError

WORLD = rig().document["cameras"]["eye"]["world"]


@pytest.mark.parametrize(
    ("values", "seen"),
    [
        ({"quaternion": np.nan}, False),
        ({"quaternion": 0.0}, False),
        ({"position": np.inf}, False),
        ({"covariance": np.inf}, True),
        ({"covariance": np.diag([-1e-4] * 6)}, True),
        ({"covariance": 0.0}, True),
    ],
    ids=["no number", "no length", "infinite place", "infinite doubt", "negative doubt", "no doubt"],
)
def test_a_pose_that_cannot_be_costs_its_image_alone(values, seen):
    stream = view("index", seconds=5.0)
    odd = np.zeros(len(stream.sample_ns), bool)
    odd[40:60:4] = True
    made = sightings_of("index", [changed(stream, odd, **values)], rig())
    assert len(made) == len(odd) - (0 if seen else odd.sum())
    path = acquire(made, stream.sample_ns, choose(made))
    off = np.linalg.norm(path.position - truth_at("index", stream.sample_ns)[:, :3, 3], axis=1)
    assert 1000 * off.max() < 1.0 and np.isfinite(path.covariance).all()


def camera(**changes):
    entry = copy.deepcopy(rig().document["cameras"]["eye"])
    for path, value in changes.items():
        entry[path] = {**entry[path], **value}
    return {**rig().document, "cameras": {"eye": entry}}


def index(what, **values):
    fingers = copy.deepcopy(FINGERS)
    fingers["fingers"]["index"][what] |= values
    return {**rig().document, "fingers": fingers}


@pytest.mark.parametrize(
    ("document", "words"),
    [
        (camera(world={"position": [100.0, -360.0, 360.0]}), "518.845 m away: are these millimetres"),
        (camera(world={"position": [np.nan, 0.0, 0.0]}), "a position nan m away"),
        (camera(world={"spread": {"position": 0.0002, "rotation": 2.0}}), "rotation of 2 rad: are these degrees"),
        (camera(world={"spread": {"position": 0.2, "rotation": 0.001}}), "position of 0.2 m: are these millimetres"),
        (camera(world={"spread": {"position": -0.001, "rotation": 0.001}}), "position of -0.001 m"),
        (camera(intrinsics={"fx": -880.0}), "fx -880"),
        (
            camera(intrinsics={"fx": 4.0, "fy": 4.0}),
            "fx 4.0, fy 4.0 px for an image 800 px wide: are these millimetres",
        ),
        (index("tip", position=[0.010, 0.0, -0.018]), "inside the cube of 20 mm: is it in metres"),
        (index("tip", position=[10000.0, 0.0, -18000.0]), "away from its cube: is it in micrometres"),
        (index("cube", side=0.020, tag=0.016), "a side of 0.02 mm: is it in another unit"),
    ],
)
def test_a_rig_file_in_another_unit_is_refused_with_its_figure(document, words):
    with pytest.raises(FormatError) as error:
        demo_rig_of(document, "bench.yaml")
    assert words in str(error.value)
    assert demo_rig_of(camera(intrinsics=INTRINSICS, world=WORLD), "bench.yaml").cameras


BOARD = {"version": "1.0", "columns": 9, "rows": 6, "square": 25.0, "marker": 18.0, "dictionary": "4X4_50"}


def pair(**changes):
    """A rig of two cameras, of which the second's file says something else."""
    document = copy.deepcopy(rig(cameras=("eye", "other")).document)
    document["cameras"]["eye"]["world"]["board"] = BOARD
    document["cameras"]["other"]["world"] |= {"board": {**BOARD, "square": 25.2}, **changes}
    return document


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"camera": "eye"}, "the world of camera other is a file of camera eye"),
        ({"camera": "camera"}, "cameras eye and other stand in the same place: is one file named twice"),
        (
            {"board": {**BOARD, "columns": 11}},
            "different boards, of 9 x 6 squares of 25 mm and 11 x 6 squares of 25 mm",
        ),
        ({"board": {**BOARD, "square": 30.0}}, "9 x 6 squares of 30 mm"),
        ({"frame": "robot"}, r"cameras in several worlds (robot, table)"),
    ],
)
def test_the_file_of_another_camera_or_board_is_refused_by_name(changes, words):
    with pytest.raises(FormatError) as error:
        demo_rig_of(pair(**changes), "bench.yaml")
    assert words in str(error.value)


def test_a_board_that_was_measured_twice_is_one_board():
    moved = pair(camera="camera", position=[0.2, -0.36, 0.36])
    assert set(demo_rig_of(moved, "bench.yaml").worlds) == {"eye", "other"}
