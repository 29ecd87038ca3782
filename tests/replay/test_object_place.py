"""The object's place: by an object file or the first touch, never by the predicted depth."""

from dataclasses import replace

import numpy as np
import pytest
from test_replay_verb import run
from tracked_hand import tracks

from tacdata.demonstrations.compensation import read_gains
from tacdata.demonstrations.paths.tracks_file import read_tracks
from tacdata.errors import FormatError
from tacdata.indenters.sphere import Sphere
from tacdata.replay.comparison.trials import Trials
from tacdata.replay.scene import drawn, read_object, scene_of
from tacdata.rig import Registration
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.hand import PERIOD, draw_hand
from tacdata.virtual_rig.world.world import World, draw

GAINS = {"compensated": read_gains().of("grasp")}
FILE = """version: "1.0"
name: tin
geometry: cylinder
sizes: [0.031, 0.05]
mass: 0.3
friction: 0.6
place: {frame: table, position: [0.001, 0.002, 0.036], spread: 0.0005}
"""


def demonstration(folder, seed=1, thing="ball"):
    task = "wipe" if thing == "eraser" else "grasp"
    return read_tracks(tracks(folder, draw_hand(seed, task, thing), task, "a" * 64))


def with_depth(made, share):
    """The same demonstration, whose depth is predicted as a share of the true one."""
    felt = {name: replace(track, depth=share * track.depth) for name, track in made.tracks.items()}
    return replace(made, tracks=felt)


def test_an_error_of_depth_moves_the_targets_and_not_the_object(tmp_path):
    made = demonstration(tmp_path)
    right, shallow = (Trials(with_depth(made, share), GAINS, scene_of("grasp")) for share in (1.0, 0.3))
    assert np.array_equal(right.place.centre, shallow.place.centre)
    ends = [tried.one("compensated", scene_of("grasp")) for tried in (right, shallow)]
    assert [end.held for end in ends] == [True, False] and ends[1].grip < 0.6 * ends[0].grip
    # Arms that know nothing of depth keep their time of touch.
    touch = [np.ptp(t.paths["close 1 mm"].position - t.paths["direct"].position, axis=0) for t in (right, shallow)]
    assert np.array_equal(*touch)


def with_boards(made, hand):
    """The same demonstration, with the readings of emulated boards: skins that differ, and noise."""
    skin, felt = default_sensor(), {}
    for number, (name, track) in enumerate(made.tracks.items()):
        world = World(draw(100 * hand.seed + number, skin, Registration((0.0, 0.0, 0.0), 0.0)), skin)
        presses = [np.array(hand.press(name, t)) * (1, 1, -1) for t in made.seconds]
        counts = [world.readings(p, Sphere(hand.nub), 0.0, int(t)) for p, t in zip(presses, made.time_ns, strict=True)]
        felt[name] = replace(track, signals=np.float32(counts - np.mean(counts[:15], axis=0)))
    return replace(made, tracks=felt)


@pytest.mark.parametrize("thing", ["ball", "can", "box", "eraser"])
@pytest.mark.parametrize("seed", [31, 32])
def test_the_first_touch_finds_the_object_where_the_hand_has_it(tmp_path, thing, seed):
    made, hand = demonstration(tmp_path, seed, thing), draw_hand(seed, "wipe" if thing == "eraser" else "grasp", thing)
    scene = scene_of(made.task, thing)
    place = Trials(with_boards(made, hand), {}, scene).place
    seconds = np.arange(0, PERIOD, 0.01)
    first = seconds[np.argmax([hand.press("thumb", t)[2] > 0.1 * hand.depth["thumb"] for t in seconds])]
    off = place.centre - hand.centre(first)
    assert np.linalg.norm(off) < 0.001 and (np.abs(off) < 3 * place.spread).all()
    # Along a flat face fingers are at 0, 14 and -14 mm, and nothing else shows its middle.
    assert bool(place.spread[1] > 0.007) is (thing in ("box", "eraser")) and place.spread[[0, 2]].max() < 0.0015


def test_scenes_differ_by_the_uncertainty_of_the_place():
    scene, spread = scene_of("grasp"), np.array([0.001, 0.01, 0.0])
    off = np.array([np.subtract(drawn(scene, 3, k, spread).place, drawn(scene, 3, k).place) for k in range(200)])
    assert off.std(axis=0) == pytest.approx(spread, rel=0.15, abs=1e-9)


def test_an_object_file_states_size_mass_friction_and_place(tmp_path, capsys):
    (tmp_path / "tin.yaml").write_text(FILE)
    values, place = read_object(tmp_path / "tin.yaml", {"table"})
    scene = scene_of("grasp", **values)
    assert (scene.name, scene.reach, scene.mass, scene.friction) == ("tin", 0.031, 0.3, 0.6)
    assert place is not None and place.centre == pytest.approx([0.001, 0.002, 0.036]) and place.spread[0] == 0.0005
    with pytest.raises(FormatError, match="frame 'table'"):
        read_object(tmp_path / "tin.yaml", {"base"})
    (tmp_path / "ball.yaml").write_text(FILE.replace("cylinder", "sphere"))
    with pytest.raises(FormatError, match="2 sizes of a sphere"):
        read_object(tmp_path / "ball.yaml", {"table"})
    path = tracks(tmp_path, draw_hand(1), "grasp", "a" * 64)
    assert run(["replay", path, "--seeds", "1", "--object", tmp_path / "tin.yaml"]) == 0
    assert "the object is at (0.0010, 0.0020, 0.0360) m, known to 0.5 x 0.5 x 0.5 mm, by" in capsys.readouterr().out
