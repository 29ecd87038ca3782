"""A camera that is bumped in mid-recording is named, with when and how far; what it saw is not believed blindly."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from demo_examples import START, changed, recording, rig, truth_at, view
from scipy.spatial.transform import Rotation

from tacdata.clock import Clock
from tacdata.demonstrations.paths.background import _followed
from tacdata.demonstrations.paths.camera_bumps import jumps
from tacdata.demonstrations.paths.sightings import sightings_of
from tacdata.demonstrations.paths.tracking import track
from tacdata.demonstrations.recording.recorder import DemoHeader
from tacdata.errors import UsageError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.replay.targets import check_guesses, targets_of
from tacdata.virtual_rig.demo import INTRINSICS
from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import expose

NAMES = ("thumb", "index", "middle")
TWO = {"cameras": ("eye", "other")}
AT = 3.4
"""When the bump comes [s]: while the ball is lifted."""


def bumped(stream, millimetres, degrees, seconds=AT):
    """What a camera says that was moved, at a time, by a distance and an angle."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.0, 0.6, 0.8]))
    after = stream.sample_ns > START + round(seconds * 1e9)
    moved = turn.apply(stream.position) + 0.001 * millimetres * np.array([0.8, -0.6, 0.0])
    turned = (turn * Rotation.from_quat(stream.quaternion)).as_quat()
    return changed(stream, after, position=moved, quaternion=turned)


def two(camera, millimetres, degrees):
    """Both cameras on all fingers, of which one is bumped."""
    made = [view(name, camera=one, seed=k) for k, one in enumerate(TWO["cameras"]) for name in NAMES]
    return tuple(bumped(stream, millimetres, degrees) if stream.camera == camera else stream for stream in made)


def errors(made):
    off = [t.position - truth_at(name, made.time_ns)[:, :3, 3] for name, t in made.tracks.items()]
    return 1000 * np.concatenate(off)


def spreads(made):
    parts = [t.covariance[:, range(3, 6), range(3, 6)] for t in made.tracks.values()]
    return 1000 * np.sqrt(np.concatenate(parts))


MORE = pytest.mark.long("tacdata/demonstrations", "tacdata/tags", reason="more bumps of the same two cameras")


@pytest.mark.parametrize(
    ("camera", "millimetres", "degrees"),
    [pytest.param("eye", 3.0, 0.0, marks=MORE), pytest.param("other", 10.0, 1.5, marks=MORE), ("other", 2.0, 0.0)],
)
def test_the_bumped_one_of_two_cameras_is_named_and_the_path_stays_right(tmp_path, camera, millimetres, degrees):
    made = track(recording(tmp_path, views=two(camera, millimetres, degrees), **TWO))
    (words,) = made.remarks
    assert words.startswith(f"camera {camera} was moved {AT:.1f} s after the beginning: it shows the fingers ")
    assert float(words.split(" mm apart")[0].split()[-1]) == pytest.approx(millimetres, rel=0.35)
    off = errors(made)
    assert np.nanmax(np.abs(off)) < 2.0 and (np.abs(off) > 3 * spreads(made)).mean() < 0.01
    assert sum(t.outliers for t in made.tracks.values()) <= 3
    assert not any(t.gap[np.isfinite(t.position[:, 0])].any() for t in made.tracks.values())
    check_guesses(targets_of(made, None))


def test_cameras_that_stand_still_raise_no_alarm():
    bench, quiet = rig(**TWO), []
    for seed in range(20):
        seen = {
            name: sightings_of(
                name, [view(name, camera=c, seed=10 * seed + k) for k, c in enumerate(TWO["cameras"])], bench
            )
            for name in NAMES
        }
        quiet.append(jumps(seen, START) == [])
    assert all(quiet)


def test_a_camera_that_stood_elsewhere_all_along_was_not_bumped(tmp_path):
    views = two("", 0.0, 0.0)
    off = tuple(bumped(s, 3.0, 0.0, seconds=-1.0) if s.camera == "other" else s for s in views)
    assert not [words for words in track(recording(tmp_path, views=off, **TWO)).remarks if "was moved" in words]


def test_a_bump_that_nobody_saw_happen_blames_neither_and_is_a_guess(tmp_path):
    """All fingers are hidden while it happens: either camera may have moved, and neither place is known."""
    views = []
    for stream in two("other", 10.0, 0.0):
        hidden = np.abs((stream.sample_ns - START) * 1e-9 - AT) < 1.5
        views.append(changed(stream, hidden, faces=0))
    made = track(recording(tmp_path, views=tuple(views), **TWO))
    said = [words for words in made.remarks if "the motion does not tell which" in words]
    assert len(said) == 2
    with pytest.raises(UsageError, match=r"not seen for .* s by a camera in its place"):
        check_guesses(targets_of(made, None))


def test_a_bump_of_a_millimetre_is_found_and_the_path_stays_honest(tmp_path):
    """Motion does not tell which camera moved so little; half a jump of a path is no guess yet."""
    made = track(recording(tmp_path, views=two("other", 1.0, 0.0), **TWO))
    assert any(f"was moved {AT:.1f} s" in words or "was moved 3.5 s" in words for words in made.remarks)
    off = errors(made)
    assert (np.abs(off) > 3 * spreads(made)).mean() < 0.01 and np.nanmax(np.abs(off)) < 1.5
    check_guesses(targets_of(made, None))


def pictures(shift_from, noise):
    """Ten images a second of a table with a pattern, which shifts by 9 px from an image on; an arm passes by."""
    width, height = INTRINSICS["width"], INTRINSICS["height"]
    rng = np.random.default_rng(3)
    table = cv2.GaussianBlur(rng.uniform(0, 255, (height, width)).astype(np.float32), (0, 0), 4)
    table = cv2.normalize(table, None, 60, 200, cv2.NORM_MINMAX)
    for number in range(85):
        image = np.roll(table, (4, 8), (0, 1)) if shift_from is not None and number >= shift_from else table.copy()
        image[:, 40 + 3 * number : 260 + 3 * number] = 40.0
        yield expose(image, [(0, 0, width, height)], Look(), noise)


def stored(tmp_path, shift_from):
    """A file with the images of one camera, and a demonstration whose other streams are arrays."""
    bench, noise = rig(), np.random.default_rng(1)
    writer = EpisodeWriter(
        tmp_path / "episode-000000.mcap",
        DemoHeader(bench.document, {name: {} for name in bench.boards}, "grasp"),
        Clock(START, START, 1.0),
        ("eye",),
        tuple(bench.fingers),
        tuple(bench.boards),
    )
    for number, image in enumerate(pictures(shift_from, noise)):
        stamp = START + number * 100_000_000
        writer.image("eye", stamp, stamp, number, cv2.imencode(".jpg", image)[1].tobytes(), -1)
    path = writer.close(True, "", {}, {})
    millimetres = 0.0 if shift_from is None else 6.0
    away = []
    for stream in (bumped(view(name), millimetres, 0.0, 3.95) for name in NAMES):
        where = np.ones(len(stream.sample_ns), bool)
        away.append(changed(stream, where, position=stream.position + np.array([0.0, 0.0, 0.5])))
    return replace(recording(tmp_path / "..", views=tuple(away)), path=path)


def test_the_only_camera_is_caught_by_what_stands_still_behind_the_fingers(tmp_path):
    made = track(stored(tmp_path, 40))
    (words,) = made.remarks
    assert words.startswith("camera eye was moved between 3.8 and 4.0 s after the beginning")
    assert "shifted by 8.9 px" in words
    off, late = errors(made) - [0.0, 0.0, 500.0], np.tile(made.seconds > 4.2, 3)
    assert np.nanmax(np.abs(off[~late])) < 3.0 < np.nanmedian(spreads(made)[late])
    assert (np.abs(off) > 3 * spreads(made)).mean() < 0.01
    assert all(t.gap[made.seconds > 4.2].all() and not t.gap[10:110].any() for t in made.tracks.values())
    with pytest.raises(UsageError, match=r"thumb was not seen for 4.* s by a camera in its place"):
        check_guesses(targets_of(made, None))


def test_an_arm_that_passes_is_no_bump(tmp_path):
    assert track(stored(tmp_path, None)).remarks == ()


def test_tags_before_an_empty_table_are_no_background():
    """Their corners are the clearest of the image. All shift together, when the hand stops near where it began."""
    rng, images = np.random.default_rng(5), []
    tag = np.kron(rng.integers(0, 2, (8, 8)), np.ones((6, 6))) * 180 + 40
    for number in range(6):
        image = 110 + 3 * rng.standard_normal((480, 640))
        for k in range(6):
            left, top = 230 + 55 * (k % 3) + (3 if number > 2 else 0), 200 + 55 * (k // 3)
            image[top : top + 48, left : left + 48] = tag
        images.append((number * 100_000_000, np.clip(np.rint(image), 0, 255).astype(np.uint8)))
    assert _followed(images) == []
    textured = [
        (time, np.roll(table, 3 if k > 2 else 0, 1))
        for k, (time, _) in enumerate(images)
        for table in [next(pictures(None, np.random.default_rng(1)))]
    ]
    assert [round(look.shift) for look in _followed(textured)] == [0, 0, 0, 3, 3, 3]
