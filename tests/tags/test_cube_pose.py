"""Poses from rendered images, where the truth is known."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tacdata.errors import FormatError, UsageError
from tacdata.tags import Cube, detect_cube, detect_tags
from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import FACES, render_cube, render_scene

INTRINSICS = {"width": 1280, "height": 720, "fx": 900.0, "fy": 900.0, "cx": 639.5, "cy": 359.5}
CUBE = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}


def placed(rotation, position):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def random_pose(rng, distance=0.4):
    """A pose anywhere in view whose mounting face is not turned to the camera."""
    while True:
        rotation = Rotation.random(random_state=rng).as_matrix()
        if rotation[2, 2] < 0.3:
            break
    across, down = distance * rng.uniform(-0.25, 0.25), distance * rng.uniform(-0.15, 0.15)
    return placed(rotation, [across, down, distance])


def errors(pose, truth):
    """Position error [mm] and rotation error [deg]."""
    turn = Rotation.from_matrix(pose.matrix[:3, :3].T @ truth[:3, :3]).magnitude()
    return 1000 * np.linalg.norm(pose.position - truth[:3, 3]), np.degrees(turn)


def facing(pitch, yaw, position=(0.0, 0.0, 0.4)):
    """A pose that shows face +z, tilted by two angles [deg]."""
    return placed(Rotation.from_euler("xyz", [180 + pitch, yaw, 0], degrees=True).as_matrix(), position)


@pytest.fixture(scope="module")
def accuracy():
    rng = np.random.default_rng(2026)
    rows = []
    for _ in range(60):
        truth = random_pose(rng)
        pose = detect_cube(render_cube(truth, INTRINSICS, CUBE, rng), INTRINSICS, CUBE)
        assert pose is not None
        rows.append((*errors(pose, truth), pose.faces, pose.reprojection))
    return np.array(rows)


def test_position_and_rotation_at_40_cm(accuracy):
    position, rotation = accuracy[:, 0], accuracy[:, 1]
    # Wanted: 0.32 mm, 0.98 mm (p95), 0.18 deg; half of that is asserted, a quarter was measured.
    assert np.median(position) <= 0.16
    assert np.percentile(position, 95) <= 0.5
    assert np.median(rotation) <= 0.09
    assert np.percentile(rotation, 95) <= 0.5


def test_no_pose_is_flipped(accuracy):
    assert (accuracy[:, 2] == 1).sum() >= 8, "the set holds views with one detected face"
    assert accuracy[:, 1].max() < 3.0
    assert accuracy[:, 3].max() < 1.5


@pytest.mark.parametrize("distance", [0.12, 0.8])
def test_near_and_far(distance):
    rng = np.random.default_rng(5)
    rows = []
    for _ in range(12):
        truth = random_pose(rng, distance)
        pose = detect_cube(render_cube(truth, INTRINSICS, CUBE, rng), INTRINSICS, CUBE)
        if pose is not None:
            rows.append(errors(pose, truth))
    assert len(rows) >= 10
    assert np.median(np.array(rows)[:, 0]) / 1000 < 0.0025 * distance


def test_distortion_is_taken_out():
    bent = {**INTRINSICS, "distortion": [-0.25, 0.06, 0.001, 0.001]}
    rng = np.random.default_rng(6)
    truths = [random_pose(rng) for _ in range(10)]
    found = [(detect_cube(render_cube(t, bent, CUBE, rng), bent, CUBE), t) for t in truths]
    assert np.median([errors(pose, t)[0] for pose, t in found if pose is not None]) < 0.2
    # The same image taken for an undistorted one is millimetres off: the correction is not idle.
    wrong = detect_cube(render_cube(truths[0], bent, CUBE, rng), INTRINSICS, CUBE)
    assert wrong is not None and errors(wrong, truths[0])[0] > 1.0


def test_a_clear_image_outvotes_a_wrong_hint():
    rng = np.random.default_rng(7)
    lone = {**CUBE, "ids": {"+z": 4}}
    truth = facing(12, 20)
    image = render_cube(truth, INTRINSICS, lone, rng)
    pose = detect_cube(image, INTRINSICS, lone)
    assert pose is not None and pose.faces == 1 and errors(pose, truth)[1] < 1.5
    mirrored = detect_cube(render_cube(facing(-12, -20), INTRINSICS, lone, rng), INTRINSICS, lone)
    again = detect_cube(image, INTRINSICS, lone, hint=mirrored)
    assert again is not None and errors(again, truth)[1] < 1.5, "a clear image outvotes a wrong hint"
    assert not again.ambiguous


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_hint_decides_where_the_image_cannot(seed):
    rng = np.random.default_rng(seed)
    lone = {**CUBE, "ids": {"+z": 4}}
    truth = facing(25, 12.5, (0.0, 0.0, 0.9))  # 14 px, one face
    image = render_cube(truth, INTRINSICS, lone, rng)
    near = facing(21, 10, (0.0, 0.0, 0.25))
    before = detect_cube(render_cube(near, INTRINSICS, lone, rng), INTRINSICS, lone)
    alone, pose = detect_cube(image, INTRINSICS, lone), detect_cube(image, INTRINSICS, lone, hint=before)
    assert alone is not None and alone.ambiguous
    assert pose is not None and errors(pose, truth)[1] < 3.0


def test_a_covered_corner_and_motion_blur():
    rng = np.random.default_rng(8)
    truth = placed(Rotation.from_euler("xyz", [150, 25, 10], degrees=True).as_matrix(), [0.0, 0.0, 0.3])
    image = render_cube(truth, INTRINSICS, CUBE, rng)
    centre = (truth[:2, 3] / truth[2, 3] * 900 + [639.5, 359.5]).astype(int)
    covered = image.copy()
    cv2.circle(covered, (int(centre[0]) + 30, int(centre[1]) + 18), 12, 90, -1)
    pose = detect_cube(covered, INTRINSICS, CUBE)
    assert pose is not None and errors(pose, truth)[0] < 0.5
    smeared = cv2.filter2D(image, -1, np.ones((1, 5)) / 5)
    pose = detect_cube(smeared, INTRINSICS, CUBE)
    assert pose is not None and errors(pose, truth)[0] < 0.5


def test_a_second_tag_with_a_known_id_is_an_outlier():
    rng = np.random.default_rng(9)
    truth = placed(Rotation.from_euler("xyz", [150, 25, 10], degrees=True).as_matrix(), [0.0, 0.0, 0.3])
    image = render_cube(truth, INTRINSICS, CUBE, rng)
    for number in (0, 4):  # one that the cube does not show here, one that it does
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        sheet = np.full((80, 80), 225, np.uint8)
        sheet[14:66, 14:66] = cv2.resize(
            cv2.aruco.generateImageMarker(family, number, 8), (52, 52), interpolation=cv2.INTER_NEAREST
        )
        pasted = image.copy()
        pasted[100:180, 200:280] = sheet
        assert number in [tag.id for tag in detect_tags(pasted) if tag.corners[:, 0].max() < 300]
        pose = detect_cube(pasted, INTRINSICS, CUBE)
        assert pose is not None and pose.faces >= 2 and errors(pose, truth)[0] < 0.3


def test_colour_and_grey_agree():
    rng = np.random.default_rng(10)
    image = render_cube(facing(30, 20), INTRINSICS, CUBE, rng)
    grey, colour = detect_cube(image, INTRINSICS, CUBE), detect_cube(cv2.merge([image] * 3), INTRINSICS, CUBE)
    assert grey is not None and colour is not None
    np.testing.assert_allclose(grey.position, colour.position, atol=1e-9)
    assert np.linalg.norm(grey.quaternion) == pytest.approx(1.0)
    assert set(grey.ids) <= set(CUBE["ids"].values()) and len(grey.ids) == grey.faces


def test_nothing_there_is_none():
    rng = np.random.default_rng(11)
    away = placed(np.eye(3), [0.0, 0.0, 0.4])  # only the mounting face is seen
    images = [
        render_cube(away, INTRINSICS, CUBE, rng),
        np.zeros((720, 1280), np.uint8),
        np.full((720, 1280), 255, np.uint8),
        rng.integers(0, 256, (720, 1280)).astype(np.uint8),
        cv2.GaussianBlur(rng.integers(0, 256, (720, 1280)).astype(np.uint8), (0, 0), 3),
        (np.indices((720, 1280)).sum(axis=0) // 20 % 2 * 255).astype(np.uint8),
    ]
    for image in images:
        assert detect_cube(image, INTRINSICS, CUBE) is None
    other = {**CUBE, "ids": {"+x": 100, "+z": 104}}
    assert detect_cube(render_cube(facing(20, 20), INTRINSICS, CUBE, rng), INTRINSICS, other) is None


def test_cut_by_the_image_border():
    rng = np.random.default_rng(12)
    truth = facing(25, 20, (0.27, 0.0, 0.4))
    image = render_cube(truth, INTRINSICS, CUBE, rng)
    for shift in range(0, 60, 6):
        rolled = image[:, : 1280 - shift].copy()
        narrow = {**INTRINSICS, "width": rolled.shape[1]}
        pose = detect_cube(rolled, narrow, CUBE)
        assert pose is None or errors(pose, truth)[0] < 2.0


def test_bad_images_are_refused():
    good = np.zeros((720, 1280), np.uint8)
    four = np.zeros((720, 1280, 4), np.uint8)
    for image in (good.astype(np.float32), good[None, None], four, None, good[:0]):
        with pytest.raises(UsageError, match="image"):
            detect_cube(image, INTRINSICS, CUBE)
    with pytest.raises(UsageError, match="640 x 480"):
        detect_cube(np.zeros((480, 640), np.uint8), INTRINSICS, CUBE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tag": 21.0}, "21"),
        ({"ids": {}}, "no face"),
        ({"ids": {"-z": 1}}, "-z"),
        ({"ids": {"+x": 1, "-x": 1}}, "different"),
        ({"ids": {"+x": 587}}, "586"),
    ],
)
def test_bad_cubes_are_refused(change, words):
    with pytest.raises(FormatError, match=words):
        Cube.from_document({**CUBE, **change})
    with pytest.raises(FormatError, match="side"):
        Cube.from_document({"tag": 16.0, "ids": {"+x": 1}})


@pytest.mark.parametrize("change", [{"fx": 0.0}, {"cx": float("nan")}, {"distortion": [0.1, 0.2]}])
def test_bad_intrinsics_are_refused(change):
    with pytest.raises(FormatError, match="calibrate"):
        detect_cube(np.zeros((720, 1280), np.uint8), {**INTRINSICS, **change}, CUBE)
    with pytest.raises(FormatError, match="fy"):
        short = {k: v for k, v in INTRINSICS.items() if k != "fy"}
        detect_cube(np.zeros((720, 1280), np.uint8), short, CUBE)


def test_corner_convention_agrees_with_the_renderer():
    """The corners that `Cube` states, projected by hand, lie where the detector sees them."""
    rng = np.random.default_rng(13)
    cube = Cube.from_document(CUBE)
    seen = set()
    for _ in range(8):
        truth = random_pose(rng, 0.15)
        for tag in detect_tags(render_cube(truth, INTRINSICS, CUBE, rng), whole=False):
            face = cube.faces[tag.id]
            points = cube.corners(face) @ truth[:3, :3].T + truth[:3, 3]
            pixels = points[:, :2] / points[:, 2:] * 900 + [639.5, 359.5]
            assert np.abs(pixels - tag.corners).max() < 2.0
            seen.add(face)
    assert seen == set(CUBE["ids"]) == set(FACES) - {"-z"}


def covered(truth, along, share=0.25):
    """A grey edge over a share of the cube's outline, from a direction [rad], as a finger that holds something."""
    out, aside = np.array([np.cos(along), np.sin(along)]), np.array([-np.sin(along), np.cos(along)])
    size = 900 * 0.026 / truth[2, 3]
    edge = 900 * truth[:2, 3] / truth[2, 3] + (639.5, 359.5) + (0.5 - share) * size * out
    near, far = (edge - size * aside, edge + size * aside), (edge + size * (aside + out), edge + size * (out - aside))
    return tuple((float(x), float(y)) for x, y in (*near, *far))


CONDITIONS = {
    "blur and noise": lambda truth, random: Look(blur=1.2, noise=5.0),
    "moving": lambda truth, random: Look(shift=(0.001, 0.0, 0.0), turn=(0.0, 0.02, 0.0)),
    "half the light": lambda truth, random: Look(gain=0.5, fall=0.5),
    "JPEG": lambda truth, random: Look(jpeg=60),
    "covered": lambda truth, random: Look(blur=1.0, noise=4.0, covers=(covered(truth, random.uniform(0, 6.3)),)),
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_bad_images_at_40_cm(condition):
    random = np.random.default_rng(31)
    rows, missed = [], 0
    for _ in range(16):
        truth = random_pose(random)
        image = render_scene([(truth, CUBE)], INTRINSICS, random, CONDITIONS[condition](truth, random))
        pose = detect_cube(image, INTRINSICS, CUBE)
        if pose is None:
            missed += 1
            assert not detect_tags(image), "a pose whenever a tag can be read at all"
        elif not pose.ambiguous:
            rows.append(errors(pose, truth))
    position, rotation = np.array(rows).T
    assert missed <= (10 if condition == "covered" else 0)
    assert np.median(position) <= 0.32 and np.median(rotation) <= 0.18
    assert np.percentile(position, 95) <= 1.0
    assert rotation.max() < 3.0, "no flipped pose that is not marked as ambiguous"


def test_the_other_pose_of_an_ambiguous_face_is_told():
    random = np.random.default_rng(3)
    lone = {**CUBE, "ids": {"+z": 4}}
    found = []
    for azimuth in np.linspace(0, 2 * np.pi, 8, endpoint=False):
        truth = facing(12 * np.cos(azimuth), 12 * np.sin(azimuth), (0.03, 0.02, 0.5))
        image = render_scene([(truth, lone)], INTRINSICS, random, Look(blur=1.0, noise=5.0))
        pose = detect_cube(image, INTRINSICS, lone)
        assert pose is not None
        best = errors(pose, truth)[1]
        other = errors(pose.rival, truth)[1] if pose.rival is not None else np.inf
        assert (pose.rival is not None) == pose.ambiguous
        assert min(best, other) < 4.0, "one of the two is the pose"
        found.append((best > 4.0, pose.ambiguous))
    assert all(ambiguous for wrong, ambiguous in found if wrong), "undecidable is said to be so"
    assert any(ambiguous for _, ambiguous in found)


def crowded(random):
    """A bench full of things with corners and letters."""
    image = np.full((720, 1280), 120, np.uint8)
    for _ in range(120):
        corner, size, grey = random.integers(0, (1200, 680)), int(random.integers(8, 90)), int(random.integers(0, 256))
        x, y = corner.tolist()
        if grey % 3:
            cv2.rectangle(image, (x, y), (x + size, y + int(random.integers(8, 90))), grey, -1)
        else:
            cv2.putText(image, "36h11", (x, y), 0, size / 40, grey, 2, cv2.LINE_AA)
    return image


def test_a_crowded_bench_hides_nothing_and_invents_nothing():
    random = np.random.default_rng(17)
    for _ in range(4):
        bench, truth = crowded(random), random_pose(random)
        image = render_scene([(truth, CUBE)], INTRINSICS, random, Look(background=bench))
        pose = detect_cube(image, INTRINSICS, CUBE)
        assert pose is not None and errors(pose, truth)[0] < 0.4
        again = detect_cube(image, INTRINSICS, CUBE, hint=pose)
        assert again is not None and np.allclose(again.position, pose.position, atol=1e-4)
        assert detect_tags(bench, whole=False) == []
        assert detect_cube(bench, INTRINSICS, CUBE, hint=pose) is None


def test_the_cheap_search_finds_what_the_library_finds():
    random = np.random.default_rng(23)
    wanted = found = 0
    for distance in (0.25, 0.4, 0.6):
        for _ in range(4):
            image = render_cube(random_pose(random, distance), INTRINSICS, CUBE, random)
            whole = {tag.id for tag in detect_tags(image)}
            wanted, found = (
                wanted + len(whole),
                found + len(whole & {tag.id for tag in detect_tags(image, whole=False)}),
            )
    assert wanted > 15 and found >= 0.95 * wanted
