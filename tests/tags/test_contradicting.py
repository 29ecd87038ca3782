"""Which tags are said to sit wrongly: those elsewhere than the pose has them, not those read badly."""

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.tags import Cube
from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.corners import contradicting
from tacdata.tags.detection.tag import Tag

CAMERA = PinholeCamera.from_document({"width": 1280, "height": 720, "fx": 900.0, "fy": 900.0, "cx": 639.5, "cy": 359.5})
CUBE = Cube.from_document({"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}})
TURN = Rotation.from_euler("xyz", [180 + 35, 30, 0], degrees=True).as_matrix()
PLACE = np.array([0.02, 0.01, 0.4])


def read(number, face):
    """A tag as it is read on a face of the cube."""
    return Tag(number, CAMERA.project(CUBE.corners(face) @ TURN.T + PLACE), 50.0, 0)


def named(*tags):
    return [tag.id for tag in contradicting(list(tags), TURN, PLACE, CUBE, CAMERA)]


def test_a_tag_in_its_place_is_not_named_even_if_its_corners_are_read_badly():
    good = read(4, "+z")
    rough = Tag(4, good.corners + 0.15 * good.size * np.array([[1, 0], [-1, 1], [0, -1], [1, 1]]), 20.0, 2)
    assert named(good) == [] and named(rough) == []


def test_tags_on_each_others_faces_and_turned_ones_are_named():
    seen = [face for face in ("+x", "-x", "+y", "-y") if (TURN @ normal(face)) @ PLACE < -0.002]
    assert len(seen) == 2
    one, other = (CUBE.ids[face] for face in seen)
    assert named(read(one, seen[1]), read(other, seen[0])) == [one, other]
    turned = read(4, "+z")
    assert named(Tag(4, np.roll(turned.corners, 2, axis=0), 50.0, 0)) == [4]


def normal(face):
    return CUBE.corners(face).mean(axis=0) / 0.01


def test_another_cubes_tag_of_the_same_number_is_named():
    far = read(4, "+z")
    assert named(Tag(4, far.corners + 200.0, 50.0, 0)) == [4]
