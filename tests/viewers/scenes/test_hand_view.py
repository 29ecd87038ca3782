"""A hand is shown whole: every finger in every panel, each in its colour, and what is a guess is marked."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.replay.targets import targets_of
from tacdata.sensor import default_sensor
from tacdata.viewers.pictures import film
from tacdata.viewers.pictures.hand_film import HandPage, apart
from tacdata.viewers.pictures.pages import other_page
from tacdata.viewers.scene.scene import CameraView
from tacdata.viewers.scenes.hand import demonstration_scene, targets_scene

FINGERS = ("thumb", "index", "middle")
COUNT = 60


def track(number, name):
    position = np.zeros((COUNT, 3))
    position[:, 0], position[:, 2] = 0.03 * number, np.linspace(0.05, 0.1, COUNT)
    gap = np.zeros(COUNT, bool)
    covariance = np.tile(1e-8 * np.eye(6), (COUNT, 1, 1))
    if name == "middle":
        gap[20:50] = True
        covariance[30:45] *= 1e4  # 10 mm
    depth = np.full((COUNT, 35, 26), 0.2 * (1 + number), np.float32)
    return FingerTrack(
        name,
        "right",
        name,
        position,
        np.tile((0.0, 0.0, 0.0, 1.0), (COUNT, 1)),
        covariance,
        gap,
        30,
        0,
        np.zeros((COUNT, 24), np.float32),
        depth,
    )


@pytest.fixture
def made():
    tracks = {name: track(k, name) for k, name in enumerate(FINGERS)}
    network = {"hash": "a" * 64, "network": "paper", "epoch": 1, "lookahead": 4, "sensor": "b" * 64}
    return Demonstration(
        "x.mcap",
        "c" * 64,
        "grasp",
        "table",
        30.0,
        (1e9 * np.arange(COUNT) / 30).astype(np.int64),
        tracks,
        dict.fromkeys(FINGERS, default_sensor()),
        {},
        network,
    )


def titles(scene):
    return [axes.get_title() or axes.get_title(loc="left") for axes in other_page(scene).axes]


def test_every_finger_has_its_panels_and_its_colour(made):
    scene = demonstration_scene("a hand", made)
    for name in FINGERS:
        for kind in ("fingertip", "spread"):
            assert f"{kind}: {name}" in titles(scene)
        assert any(name in title for title in titles(scene) if "predicted" in title)
    assert len({trail.hue for trail in scene.trails}) == 3
    asked = targets_scene("targets", targets_of(made, dict.fromkeys(FINGERS, 0.005)))
    hues = {name: {trail.hue for trail in asked.trails if trail.name.startswith(name)} for name in FINGERS}
    assert all(len(hue) == 1 for hue in hues.values()) and len(set.union(*hues.values())) == 3
    assert [trail.faint for trail in asked.trails] == [True, False] * 3
    assert "moved: middle" in titles(asked)


def test_a_bridged_stretch_is_grey_and_a_guess_is_said(made):
    scene = demonstration_scene("a hand", made)
    curves = {curve.name: curve for curve in scene.curves}
    assert curves["fingertip/middle"].doubtful.sum() == 30 and not len(curves["fingertip/index"].doubtful)
    assert "50% bridged, **of which 0.5 s are a guess** (known to 10 mm)" in scene.summary
    grey = [axes.get_title(loc="left") or axes.get_title() for axes in other_page(scene).axes if axes.collections]
    assert {"fingertip: middle", "spread: middle"} <= set(grey) and "fingertip: index" not in grey
    sure = replace(made, tracks={name: made.tracks[name] for name in ("thumb", "index")})
    assert "guess" not in demonstration_scene("a hand", sure).summary


def camera():
    """Return a camera 0.4 m above the table that looks straight down, without images."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 400.0
    matrix, empty = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]), np.zeros(0, np.int64)
    places = np.zeros((0, 3)), np.zeros((0, 4))
    return CameraView("top", 640, 480, matrix, empty, (), empty, *places, 10.0, (), pose)


def test_a_film_shows_paths_in_the_images_and_says_what_is_bridged(made):
    scene = replace(demonstration_scene("a hand", made), cameras=(camera(),))
    page = HandPage(scene)
    times = scene.bodies[0].time_ns
    (picture,) = page._cameras
    for row, said in ((5, ""), (30, "no sighting of middle, path bridged")):
        page.show(int(times[row]))
        assert page._title.get_text().endswith(said or " s")
        colors = {title.get_text(): title.get_color() for title in page._maps.titles}
        assert colors.get("middle: path bridged", "crimson") == "crimson" and colors["thumb"] == "black"
        for k, (dot, name) in enumerate(picture._marks):
            # 30 mm apart, at a height that the camera sees 600 px / distance larger.
            away = 400 - 1000 * made.tracks[FINGERS[k]].position[row, 2]
            assert dot.get_xdata()[0] == pytest.approx(320 + 600 * 30 * k / away) and dot.get_ydata()[0] == 240
            assert name.get_text() == FINGERS[k]
            assert (dot.get_markerfacecolor() == "white") == (bool(said) and k == 2)


def test_names_that_would_cover_each_other_stand_above_each_other():
    places = np.array([[0.0, 0.0], [3.0, 1.0], [4.0, 0.5], [60.0, 0.0], [np.nan, np.nan]])
    put = apart(places, 26.0, 8.0)
    assert np.isnan(put[4]).all() and put[3, 1] == put[0, 1], "a name far away, or of no place, moves none"
    assert np.diff(np.sort(put[:3, 1])).min() >= 8.0 and (put[:3, 0] == places[:3, 0]).all()


def test_a_tracked_hand_becomes_a_film(made, tmp_path, monkeypatch):
    from PIL import Image

    monkeypatch.setitem(film.MOST, ".gif", 3)
    film.FilmBackend(tmp_path / "hand.gif").draw(demonstration_scene("a hand", made))
    with Image.open(tmp_path / "hand.gif") as shown:
        assert shown.n_frames == 3
