"""Fingertips from cubes, and cubes that were mixed up."""

import copy
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tacdata.errors import FormatError
from tacdata.tags import CubePose, FingerTracker, detect_fingers, fingers_of
from tacdata.tags.mixups import exchanged, handedness
from tacdata.tags.tips import tip_of
from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import render_scene

INTRINSICS = {"width": 960, "height": 540, "fx": 900.0, "fy": 900.0, "cx": 479.5, "cy": 269.5}
FACES = ("+x", "-x", "+y", "-y", "+z")
# The pad looks along the cube's -z, the finger points along its x; the pad lies 18 mm below and 10 mm ahead.
TIP = {"position": [10.0, 0.0, -18.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}
NAMES = ("thumb", "index", "middle")


def cube(first):
    return {"side": 20.0, "tag": 16.0, "ids": {face: first + k for k, face in enumerate(FACES)}}


DOCUMENT = {
    "version": "1.0",
    "fingers": {name: {"cube": cube(5 * k), "tip": TIP, "hand": "right"} for k, name in enumerate(NAMES)},
}
FINGERS = fingers_of(DOCUMENT)
# Camera looks down on a right hand: the fingers point up in the image, the thumb is on the left.
DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0])
PLACES = {"thumb": (-0.06, 0.03, 0.4), "index": (-0.01, -0.02, 0.38), "middle": (0.035, -0.02, 0.39)}


def standing(place, angles=(14.0, -9.0, 4.0)):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix() @ DOWN
    pose[:3, 3] = place
    return pose


def scene(names=NAMES, places=PLACES, fingers=DOCUMENT["fingers"], seed=0, **look):
    cubes = [(standing(places[name]), fingers[name]["cube"]) for name in names]
    return render_scene(cubes, INTRINSICS, np.random.default_rng(seed), Look(**look))


def test_three_fingertips_in_one_image():
    view = detect_fingers(scene(), INTRINSICS, FINGERS)
    assert set(view.tips) == set(NAMES) and not view.remarks
    for name, tip in view.tips.items():
        truth = standing(PLACES[name]) @ FINGERS[name].tip
        assert 1000 * np.linalg.norm(tip.position - truth[:3, 3]) < 0.5
        turn = Rotation.from_quat(tip.quaternion).inv() * Rotation.from_matrix(truth[:3, :3])
        assert np.degrees(turn.magnitude()) < 0.5
        assert tip.cube.faces >= 1 and tip.cube.reprojection < 1.0
        # The pad looks away from the camera, at what is touched.
        assert Rotation.from_quat(tip.quaternion).as_matrix()[2, 2] > 0.8


def test_the_covariance_is_about_the_error_that_is_made():
    squares, tips = [], []
    for seed in range(12):
        random = np.random.default_rng(seed)
        truth = standing((*random.uniform(-0.1, 0.1, 2), 0.4), random.uniform(-40, 40, 3))
        image = render_scene([(truth, cube(0))], INTRINSICS, random, Look(noise=6.0))
        pose = detect_fingers(image, INTRINSICS, FINGERS).cubes["thumb"]
        turn = Rotation.from_matrix(truth[:3, :3] @ pose.matrix[:3, :3].T).as_rotvec()
        error = np.concatenate([turn, truth[:3, 3] - pose.position])
        squares.append(error @ np.linalg.solve(pose.covariance, error))
        tips.append(tip_of(pose, FINGERS["thumb"]).covariance)
    # Six numbers: the mean of the squares is six if the covariance is right.
    assert 1.0 < np.mean(squares) < 20.0
    for covariance in tips:
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_a_long_lever_makes_a_tip_less_sure():
    pose = CubePose(np.array([0, 0, 0.4]), np.array([0, 0, 0, 1.0]), 0.1, 1, (0,), covariance=np.eye(6) * 1e-6)
    near, far = (tip_of(pose, replace(FINGERS["index"], tip=at(reach))).covariance[3:, 3:] for reach in (0.0, 0.1))
    assert np.allclose(near, np.eye(3) * 1e-6)
    # 1 mrad over 100 mm is 0.1 mm, across the lever only.
    assert np.allclose(np.diag(far) - 1e-6, [0.0, 1e-8, 1e-8], atol=1e-12)


def at(reach):
    tip = np.eye(4)
    tip[0, 3] = reach
    return tip


def test_a_tag_of_one_finger_on_anothers_cube_is_noticed():
    mixed = copy.deepcopy(DOCUMENT["fingers"])
    wrong, right = mixed["index"]["cube"]["ids"], mixed["thumb"]["cube"]["ids"]
    wrong["+z"], right["+z"] = right["+z"], wrong["+z"]
    tilted = {"thumb": (-0.05, 0.0, 0.25), "index": (0.05, 0.0, 0.25)}
    cubes = [(standing(place, (40.0, 10.0, 0.0)), mixed[name]["cube"]) for name, place in tilted.items()]
    view = detect_fingers(render_scene(cubes, INTRINSICS, np.random.default_rng(0)), INTRINSICS, FINGERS)
    assert any("read away from" in remark for remark in view.remarks)
    # Seen on one cube alone, the other finger's tag puts two cubes in one place.
    one = render_scene(cubes[:1], INTRINSICS, np.random.default_rng(0))
    remarks = detect_fingers(one, INTRINSICS, FINGERS).remarks
    assert any("thumb and index are in one place" in remark for remark in remarks)


def test_two_faces_of_a_cube_swapped_are_noticed():
    mixed = copy.deepcopy(DOCUMENT["fingers"])
    ids = mixed["index"]["cube"]["ids"]
    ids["+z"], ids["-y"] = ids["-y"], ids["+z"]
    close = {"index": (0.0, 0.0, 0.2)}
    turned = [(standing(close["index"], (40.0, 10.0, 0.0)), mixed["index"]["cube"])]
    image = render_scene(turned, INTRINSICS, np.random.default_rng(0))
    view = detect_fingers(image, INTRINSICS, FINGERS)
    assert any("read away from index's cube" in remark for remark in view.remarks)


def test_swapped_hands_are_noticed():
    left = {"version": "1.0", "fingers": {n: {**e, "hand": "left"} for n, e in DOCUMENT["fingers"].items()}}
    view = detect_fingers(scene(), INTRINSICS, fingers_of(left))
    assert any("stand as those of a right one" in remark for remark in view.remarks)
    assert handedness(FINGERS, view.cubes) == "right"
    two = {"index": view.cubes["middle"], "middle": view.cubes["index"]}
    assert handedness(FINGERS, two) == "left"
    assert handedness(FINGERS, {"index": view.cubes["index"]}) == ""


def test_fingers_that_change_places_are_noticed():
    before = detect_fingers(scene(), INTRINSICS, FINGERS).cubes
    moved = {name: replace(pose, position=pose.position + 0.003) for name, pose in before.items()}
    assert exchanged(before, moved) == ()
    swapped = {**moved, "thumb": moved["middle"], "middle": moved["thumb"]}
    (remark,) = exchanged(before, swapped)
    assert "middle and thumb" in remark


def test_the_tracker_follows_and_says_when_numbers_are_swapped():
    tracker = FingerTracker(INTRINSICS, FINGERS)
    for step in range(8):
        places = {name: (x + 0.002 * step, y, z) for name, (x, y, z) in PLACES.items()}
        view = tracker.update(scene(places=places, seed=step))
        assert set(view.tips) == set(NAMES) and not view.remarks
        for name, pose in view.cubes.items():
            assert 1000 * np.linalg.norm(pose.position - places[name]) < 0.4
    other = {**places, "thumb": places["middle"], "middle": places["thumb"]}
    view = tracker.update(scene(places=other, seed=9))
    assert any("changed places" in remark for remark in view.remarks)


def test_the_tracker_finds_a_finger_again_wherever_it_comes_back():
    tracker = FingerTracker(INTRINSICS, FINGERS)
    assert set(tracker.update(scene()).tips) == set(NAMES)
    for step in range(4):
        assert set(tracker.update(scene(("thumb", "index"), seed=step)).tips) == {"thumb", "index"}
    back = {**PLACES, "middle": (0.12, 0.08, 0.45)}
    seen = [set(tracker.update(scene(places=back, seed=step)).tips) for step in range(7)]
    assert set(NAMES) in seen, "the whole image is searched now and then"
    for _ in range(2):
        assert not tracker.update(scene(())).tips
    assert set(tracker.update(scene()).tips) == set(NAMES)


def test_no_jump_between_the_two_poses_of_a_lone_face():
    """A face that turns through the square view, small and noisy: the tilt never changes its sign by a jump."""
    lone = {"side": 20.0, "tag": 16.0, "ids": {"+z": 4}}
    fingers = fingers_of({"version": "1.0", "fingers": {"index": {"cube": lone, "tip": TIP}}})
    tracker, errors = FingerTracker(INTRINSICS, fingers), []
    for step, tilt in enumerate(np.linspace(35, 12, 24)):
        truth = standing((0.02, 0.01, 0.5), (tilt, 8.0, 0.0))
        image = render_scene([(truth, lone)], INTRINSICS, np.random.default_rng(step), Look(blur=1.0, noise=5.0))
        pose = tracker.update(image).cubes["index"]
        turn = Rotation.from_matrix(pose.matrix[:3, :3].T @ truth[:3, :3]).magnitude()
        errors.append(np.degrees(turn))
    assert max(errors) < 6.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("thumb", "cube", cube(5)), "tag 5 is on"),
        (("thumb", "cube", {**cube(0), "tag": 30.0}), "thumb: cube: tag 30"),
        (("index", "tip", {"position": [0, 0, 0], "quaternion": [0, 0, 0, 0]}), "length 0"),
        (("index", "tip", {"position": [0, 0], "quaternion": [0, 0, 0, 1]}), "position"),
    ],
)
def test_bad_finger_files_are_refused(change, words):
    name, key, value = change
    broken = copy.deepcopy(DOCUMENT)
    broken["fingers"][name][key] = value
    with pytest.raises(FormatError, match=words):
        fingers_of(broken)
    with pytest.raises(FormatError):
        fingers_of({"version": "1.0", "fingers": {}})


def test_a_colour_image_is_as_good():
    image = scene()
    grey, colour = (detect_fingers(i, INTRINSICS, FINGERS).cubes for i in (image, cv2.merge([image] * 3)))
    for name in NAMES:
        np.testing.assert_allclose(grey[name].position, colour[name].position, atol=1e-9)
