"""The virtual camera's images against geometry worked out by hand."""

import numpy as np

from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import render_cube

INTRINSICS = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5}
CUBE = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}


def head_on(distance, across=0.0):
    """Face +z square to the camera, cube y up in the image."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = [across, 0.0, distance + 0.01]
    return pose


def test_the_square_has_the_size_and_place_that_perspective_gives_it():
    image = render_cube(head_on(0.1), INTRINSICS, CUBE, np.random.default_rng(0)).astype(float)
    assert image.shape == (480, 640)
    # Tag 16 mm at 100 mm: 96 px; face 20 mm: 120 px, columns 260 to 379. Edges at the half level.
    row = image[239 - 42 : 239 - 38].mean(axis=0)  # in the black border, 40 px above the centre
    level = (row[270:280].mean() + row[262:266].mean()) / 2
    dark = np.flatnonzero(row[262:378] < level) + 262
    left, right = dark[0], dark[-1]
    assert abs((right - left + 1) - 96) <= 1
    assert abs((right + left) / 2 - 319.5) <= 0.5
    assert row[262:266].mean() > 150 > row[275:360].mean()
    assert len(dark) == right - left + 1, "the border is black from edge to edge"


def test_same_seed_same_image_and_noise_as_stated():
    pose = head_on(0.2)
    first = render_cube(pose, INTRINSICS, CUBE, np.random.default_rng(1))
    again = render_cube(pose, INTRINSICS, CUBE, np.random.default_rng(1))
    other = render_cube(pose, INTRINSICS, CUBE, np.random.default_rng(2))
    assert (first == again).all() and (first != other).any()
    spread = (first.astype(float) - other)[:100, :100].std() / np.sqrt(2)
    # Rounding to whole grey values adds 1/12.
    assert abs(spread - np.sqrt(Look().noise ** 2 + 1 / 12)) < 0.1


def test_out_of_view_and_behind_show_the_bench():
    rng = np.random.default_rng
    bench = render_cube(head_on(0.2, across=1.0), INTRINSICS, CUBE, rng(3))
    behind = render_cube(head_on(-0.3), INTRINSICS, CUBE, rng(3))
    assert (bench == behind).all()
    seen = render_cube(head_on(0.2), INTRINSICS, CUBE, rng(3))
    changed = np.argwhere(seen != bench)
    assert changed.min(axis=0)[0] > 200 and changed.max(axis=0)[1] < 370


def test_vanishing_distortion_is_the_pinhole():
    bent = {**INTRINSICS, "distortion": [1e-12, 0.0, 0.0, 0.0]}
    pose = head_on(0.15)
    plain = render_cube(pose, INTRINSICS, CUBE, np.random.default_rng(4)).astype(int)
    assert np.abs(plain - render_cube(pose, bent, CUBE, np.random.default_rng(4))).max() <= 2


def test_barrel_distortion_pulls_the_cube_inwards():
    bent = {**INTRINSICS, "distortion": [-0.2, 0.0, 0.0, 0.0]}
    pose = head_on(0.2, across=0.06)

    def bright(intrinsics):
        image = render_cube(pose, intrinsics, CUBE, np.random.default_rng(5))
        return np.argwhere(image > 150)[:, 1].mean()

    # r = 0.06 / 0.2 = 0.3: the centre moves by k r^3 f = 0.2 * 0.027 * 600 = 3.24 px.
    assert abs((bright(INTRINSICS) - bright(bent)) - 3.24) < 0.4
