"""Images that a busy recorder passed over are searched afterwards."""

import cv2
import numpy as np
import pytest
from demo_examples import HAND, START, rig

from tacdata.clock import Clock
from tacdata.demonstrations.paths.second_look import look_again
from tacdata.demonstrations.paths.tracking import track
from tacdata.demonstrations.recording.reader import read_demo
from tacdata.demonstrations.recording.recorder import DemoHeader
from tacdata.errors import FormatError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.tags import look
from tacdata.virtual_rig.demo import AIM, FINGERS, INTRINSICS, tip_on_cube
from tacdata.virtual_rig.optics.render import render_scene
from tacdata.virtual_rig.optics.scene import looking_at

EYE = looking_at((0.10, -0.36, 0.36), AIM)
TIMES = 0.2 + 0.05 * np.arange(8)


def image(seconds, rng):
    """What the camera sees of the hand."""
    cubes = [
        (np.linalg.inv(EYE) @ HAND.tip(name, seconds) @ np.linalg.inv(tip_on_cube()), entry["cube"])
        for name, entry in FINGERS["fingers"].items()
    ]
    return render_scene(cubes, INTRINSICS, rng)


@pytest.fixture
def recorded(tmp_path):
    """Eight images, of which the recorder had time to search one; one of them is damaged on disk."""
    bench, rng = rig(), np.random.default_rng(0)
    path = tmp_path / "episode-000000.mcap"
    writer = EpisodeWriter(
        path,
        DemoHeader(bench.document, {name: {} for name in bench.boards}, "grasp"),
        Clock(START, START, 1.0),
        ("eye",),
        tuple(bench.fingers),
        tuple(bench.boards),
    )
    for number, seconds in enumerate(TIMES.tolist()):
        stamp = START + round(seconds * 1e9)
        jpeg = cv2.imencode(".jpg", image(seconds, rng))[1].tobytes()
        writer.image("eye", stamp, stamp, number, jpeg[:200] if number == 5 else jpeg, -1)
    found = look(image(TIMES[0], rng), INTRINSICS, bench.document["fingers"], None)
    assert set(found.tips) == set(FINGERS["fingers"])
    return writer.close(True, "", {}, {})


def mirror(image):
    return np.ascontiguousarray(image[:, ::-1])


def aruco(_):
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    page = np.full((INTRINSICS["height"], INTRINSICS["width"]), 255, np.uint8)
    page[100:200, 100:200] = cv2.aruco.generateImageMarker(markers, 7, 100)
    return page


@pytest.mark.parametrize(
    ("seen", "found", "remedy"),
    [
        (mirror, "5 of 5 images show mirrored tags", "mirroring off"),
        (aruco, "family ArUco 5x5", "family 36h11"),
        (lambda image: 255 - image, "white on black", "black on white"),
        (lambda image: image // 2 * 0, "", "light"),
    ],
    ids=["mirrored", "aruco", "inverted", "dark"],
)
def test_why_no_tag_is_seen_is_looked_for_and_named(tmp_path, seen, found, remedy):
    bench, rng = rig(), np.random.default_rng(0)
    writer = EpisodeWriter(
        tmp_path / "episode-000000.mcap",
        DemoHeader(bench.document, {name: {} for name in bench.boards}, "grasp"),
        Clock(START, START, 1.0),
        ("eye",),
        tuple(bench.fingers),
        tuple(bench.boards),
    )
    picture = seen(image(TIMES[0], rng))
    for number in range(20):
        stamp = START + number * 50_000_000
        writer.image("eye", stamp, stamp, number, cv2.imencode(".png", picture)[1].tobytes(), -1)
    with pytest.raises(FormatError, match="no finger was seen") as error:
        track(look_again(read_demo(writer.close(True, "", {}, {}))))
    assert found in error.value.given and remedy in error.value.remedy


def test_every_stored_image_is_searched_and_a_damaged_one_costs_no_other(recorded):
    before = read_demo(recorded)
    assert not before.views and "time for" in before.searched
    told = []
    after = look_again(before, told.append)
    assert told[-1] == 8 and after.searched == "all 8 images"
    assert {view.finger for view in after.views} == set(FINGERS["fingers"])
    for view in after.views:
        np.testing.assert_array_equal(view.sample_ns, START + np.rint(TIMES * 1e9).astype(np.int64))
        assert (view.faces > 0).tolist() == [k != 5 for k in range(8)]
        truth = np.array([(np.linalg.inv(EYE) @ HAND.tip(view.finger, t))[:3, 3] for t in TIMES])
        off = 1000 * np.linalg.norm(view.position - truth, axis=1)[view.faces > 0]
        assert np.median(off) < 1.0 and off.max() < 3.0
    assert not [note for note in after.notes if "away from" in note]
