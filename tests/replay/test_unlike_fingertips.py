"""Three fingertips that differ in taxels, size and map on one hand: each keeps its own, from the rig to the film."""

import sys
from pathlib import Path

import numpy as np
import pytest

from tacdata.commands.virtual_rig import _skins
from tacdata.demonstrations.paths.estimator import Estimator
from tacdata.demonstrations.paths.tracking import track
from tacdata.demonstrations.paths.tracks_file import read_tracks, write_tracks
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import exporter
from tacdata.recording.episode import TaxelStream
from tacdata.replay.comparison.trials import Trials
from tacdata.replay.scene import scene_of
from tacdata.replay.targets import targets_of
from tacdata.sensor import Sensor, default_sensor
from tacdata.viewers.pictures.page_frames import page_frames
from tacdata.viewers.pictures.replay_film import ReplayPage
from tacdata.viewers.scenes.hand import demonstration_scene
from tacdata.virtual_rig.demo import VirtualDemo

sys.path.append(str(Path(__file__).resolve().parents[1] / "demonstrations"))
from demo_examples import HAND, recording, taxels

SIZES = {"thumb": (6, 4, 35, 26), "index": (4, 3, 24, 20), "middle": (5, 2, 30, 12)}
"""Finger -> taxels and pixels along x and y."""


def skin(finger):
    columns, rows, wide, high = SIZES[finger]
    document = default_sensor().document
    return Sensor.from_document(
        {
            **document,
            "name": f"{finger} tip",
            "taxels": {**document["taxels"], "columns": columns, "rows": rows},
            "map": {**document["map"], "pixels_x": wide, "pixels_y": high},
        },
        finger,
    )


SKINS = {finger: skin(finger) for finger in SIZES}


def felt(finger):
    whole = taxels(finger)
    count = SKINS[finger].taxels.count
    return TaxelStream(whole.arrival_ns, whole.sample_ns, whole.counter, whole.counts[:, :count])


def network(finger):
    """A stand-in that knows the depth: readings are linear in it."""
    _, _, wide, high = SIZES[finger]
    identity = {"hash": f"{len(finger)}" * 64, "network": f"for the {finger}", "epoch": 1, "lookahead": 0, "sensor": ""}

    def maps(tared):
        depth = np.maximum(tared[:, 0] / 750.0, 0.0)
        return (depth[:, None, None] * np.ones((1, wide, high))).astype(np.float32)

    return Estimator(identity, SKINS[finger], maps)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """The tracks of such a hand, as their file gives them back."""
    folder = tmp_path_factory.mktemp("demos")
    documents = {finger: sensor.document for finger, sensor in SKINS.items()}
    made = recording(folder, streams={finger: felt(finger) for finger in SKINS}, sensors=documents)
    path = folder / "episode-000000.tracks.parquet"
    write_tracks(path, track(made, estimator={finger: network(finger) for finger in SKINS}))
    return read_tracks(path)


def test_readings_maps_and_skins_stay_with_their_finger(tracked):
    for finger, found in tracked.tracks.items():
        columns, rows, wide, high = SIZES[finger]
        assert found.signals.shape[1] == columns * rows and found.depth.shape[1:] == (wide, high)
        assert tracked.sensors[finger].content_hash == SKINS[finger].content_hash
        assert tracked.networks[finger]["network"] == f"for the {finger}"
        assert np.nanmax(found.depth) == pytest.approx(HAND.depth[finger], rel=0.1)
    shown = {maps.name: maps.values.shape[1:] for maps in demonstration_scene("a hand", tracked).maps}
    assert sorted(shown.values()) == sorted((wide, high) for _, _, wide, high in SIZES.values())


@pytest.mark.parametrize("form", ["lerobot", "csv", "parquet", "open_x_tactile"])
def test_every_format_holds_all_three(tracked, tmp_path, form):
    targets = targets_of(tracked, dict.fromkeys(SIZES, 0.005))
    exporter(form, None).write([targets], tmp_path / "out")
    (again,) = exporter(form, None).read(tmp_path / "out")
    assert again.fingers == tuple(SIZES) and np.allclose(again.depth, targets.depth, atol=1e-5, equal_nan=True)
    if form == "open_x_tactile":
        shapes = sorted((tmp_path / "out").glob("*.zarr/data/right_tactile_data_*"))
        assert len(shapes) == 6  # readings and maps, each finger in a group of its own shape


def test_the_ball_is_lifted_and_the_film_shows_three_maps(tracked):
    scene = scene_of("grasp", "ball")
    tried = Trials(tracked, {"chosen": dict.fromkeys(SIZES, 0.008)}, scene)
    ends = {kind: tried.one(kind, scene) for kind in tried.paths}
    assert not ends["direct"].held and ends["chosen"].held
    first, last = page_frames(ReplayPage(ends, tried.seen), np.array([0.0, 4.0]))
    assert first.shape == last.shape and (first != last).any()


def test_a_network_of_another_finger_is_refused(tmp_path):
    made = recording(
        tmp_path,
        streams={finger: felt(finger) for finger in SKINS},
        sensors={finger: sensor.document for finger, sensor in SKINS.items()},
    )
    with pytest.raises(FormatError, match=r"index wears sensor index tip .* trained for thumb tip"):
        track(made, estimator={finger: network("thumb") for finger in SKINS})


def test_an_emulated_hand_wears_them_too(tmp_path):
    demo = VirtualDemo(tmp_path / "rig", sensor={"index": SKINS["index"], "middle": SKINS["middle"]})
    try:
        document = demo.document
        assert [document["sensors"][finger]["name"] for finger in SIZES] == ["tacprint", "index tip", "middle tip"]
        assert [document["boards"][finger]["format"]["channels"]["count"] for finger in SIZES] == [24, 12, 10]
    finally:
        demo.stop()
    with pytest.raises(UsageError, match="a sensor for pinky"):
        VirtualDemo(tmp_path / "rig", sensor={"pinky": SKINS["index"]})


def test_sensor_files_are_named_by_finger(tmp_path):
    from tacdata import documents

    for finger, sensor in SKINS.items():
        documents.write(tmp_path / f"{finger}.yaml", sensor.document, "sensor")
    given = [str(tmp_path / "thumb.yaml"), f"index={tmp_path / 'index.yaml'}"]
    found = _skins(given, demo=True)
    assert [found[finger].name for finger in SIZES] == ["thumb tip", "index tip", "thumb tip"]
    for words, problem in (([given[1]] * 2, "two sensors for finger index"), ([given[0]] * 2, "for all fingers")):
        with pytest.raises(UsageError, match=problem):
            _skins(words, demo=True)
    with pytest.raises(UsageError, match="without --demo"):
        _skins([given[1]], demo=False)
