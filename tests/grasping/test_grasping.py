"""Fingertips that find where an orange lies: the skin decides what they read, friction and gravity what they hold."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.grasping import picture, result
from tacdata.grasping.bias import bias
from tacdata.grasping.centre import dense_centre, map_centre, raw_centre
from tacdata.grasping.fingertip import fingertip_sensor
from tacdata.grasping.lessons import REST, lessons
from tacdata.grasping.lift import Grip, lift, pressing
from tacdata.grasping.press_set import FOLDER, read_presses
from tacdata.grasping.presses import LEFT_OUT, RADIUS
from tacdata.grasping.strategies import strategy as strategies
from tacdata.grasping.strategies.strategy import Strategy
from tacdata.grasping.study import Setup, strategy_names
from tacdata.grasping.touch import Fingertip, FingertipSpread, OrangeTouch, mirrored
from tacdata.grasping.trial import Protocol, approach, fused
from tacdata.sensor import default_sensor

PERFECT = FingertipSpread(0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def sensor():
    """The fingertip's sensor."""
    return fingertip_sensor()


@pytest.fixture(scope="module")
def presses(sensor):
    """The orange's presses."""
    return read_presses(FOLDER / "orange.npz", sensor)


@pytest.fixture(scope="module")
def touch(presses, sensor):
    """The skin's answer."""
    return OrangeTouch(presses, sensor)


def nearest_maps(presses, sensor):
    """Return what stands in for a network: the solved map, mirrored too, whose readings are most alike."""
    signals = presses.signals(sensor)[:, 4:].reshape(-1, sensor.taxels.count)
    maps = presses.surface[:, 4:].reshape(-1, *sensor.map.shape)
    signals = np.concatenate([signals, mirrored(signals, sensor, True, False)])
    maps = np.concatenate([maps, maps[:, ::-1]])

    def estimate(frames):
        found = np.argmin(np.abs(signals - frames.mean(axis=0)).sum(axis=1))
        return np.repeat(maps[found][None], len(frames), axis=0)

    return estimate


def test_the_centroid_of_the_taxels_is_biased_to_the_interior(touch, presses, sensor):
    found = bias(touch, presses, nearest_maps(presses, sensor), 1.8, 2.0)
    off = found["toward_interior"]["raw_taxel"]
    assert 0.2 < off["2"] < off["4"] < off["6"]
    assert found["accepted_to"]["raw_taxel"] > 2.3
    assert abs(found["accepted_to"]["solved_map"] - 2.0) < 0.1
    assert abs(found["toward_interior"]["solved_map"]["4"]) < 0.1


def test_a_press_on_the_other_side_is_the_mirror_image(touch, sensor):
    here, there = (touch.signals(x, y, 1.5) for x, y in ((2.1, -1.0), (-2.1, 1.0)))
    np.testing.assert_allclose(here.reshape(4, 6), there.reshape(4, 6)[::-1, ::-1])
    one, other = raw_centre(here[None], sensor), raw_centre(there[None], sensor)
    assert one is not None and other is not None
    assert one == pytest.approx(-other) and one[0] > 1


def test_more_force_is_deeper_and_reads_more(touch):
    depths = [touch.depth(3.0, 0.5, force) for force in (0.5, 1.0, 1.8)]
    assert depths == sorted(depths)
    assert touch.signals(3.0, 0.5, 1.8).sum() > 2 * touch.signals(3.0, 0.5, 0.5).sum()
    assert np.isnan(touch.depth(0.0, 0.0, 50.0))


def test_what_is_learnt_from_never_is_the_orange(sensor):
    learnt = read_presses(FOLDER / "training.npz", sensor)
    radii = [document["radius"] for document in learnt.indenters if document["shape"] == "sphere"]
    assert LEFT_OUT[0] < RADIUS < LEFT_OUT[1]
    assert not [radius for radius in radii if LEFT_OUT[0] <= radius <= LEFT_OUT[1]]
    few = replace(learnt, counts=np.where(np.arange(len(learnt.counts)) < 2, learnt.counts, 0))
    found = lessons(few, sensor, FingertipSpread())
    assert len(found) == 8
    for one in found:
        assert one.depth.min() >= 0 and one.depth[:REST].max() == 0
        assert one.depth.max() == pytest.approx(one.tip[:, 2].max(), abs=0.1)
    untouched = np.array([one.taxels[:REST].mean(axis=0) for one in found])
    assert untouched.std() == pytest.approx(FingertipSpread().drift, rel=0.2)
    deepest = [np.array(np.unravel_index(one.depth.max(axis=0).argmax(), sensor.map.shape)) for one in found[:4]]
    assert abs(deepest[0][0] + deepest[1][0] - 34) <= 1  # mirrored along x


def test_each_centre_says_when_there_is_no_contact(sensor):
    quiet = np.random.default_rng(0).normal(0, 5, (30, 24))
    assert raw_centre(quiet, sensor) is None
    assert dense_centre(quiet, sensor, lambda frames: np.ones((len(frames), 35, 26))) is None
    assert map_centre(np.full((35, 26), 0.39), sensor) is None


def test_offsets_are_averaged_in_the_grippers_frame(touch):
    rng = np.random.default_rng(0)
    fingers = [Fingertip(touch, PERFECT, side, rng) for side in (1, -1)]
    assert fused(fingers, [np.array([3.0, 0.0]), np.array([-2.0, 0.0])]) == pytest.approx(2.5)
    assert fused(fingers, [None, np.array([-2.0, 0.0])]) == pytest.approx(2.0)
    assert fused(fingers, [None, None]) is None


def test_an_orange_at_the_edge_is_brought_into_the_band(touch, presses, sensor):
    strategy = strategies.create("dense_depth", sensor, nearest_maps(presses, sensor))
    fingers = [Fingertip(touch, PERFECT, side, np.random.default_rng(side + 1)) for side in (1, -1)]
    way = approach(fingers, 5.0, 0.0, strategy, Protocol(window=0.1), 30.0, np.random.default_rng(0))
    assert not way.stopped and abs(way.lateral) < 2.6
    assert way.adjustments == len(way.truths) - 1 >= 2


def test_a_strategy_that_never_arrives_is_stopped(touch):
    fingers = [Fingertip(touch, PERFECT, side, np.random.default_rng(0)) for side in (1, -1)]
    protocol = Protocol(window=0.1)

    class Always(Strategy):
        def centre(self, frames):
            return np.array([3.0, 0.0])

    always = Always(touch.sensor, lambda frames: frames)
    stuck = approach(fingers[:1], 0.0, 0.0, always, protocol, 30.0, np.random.default_rng(0))
    assert "safety stop" in stuck.stopped
    far = approach(
        fingers,
        60.0,
        0.0,
        strategies.create("raw_taxel", touch.sensor, lambda f: f),
        Protocol(),
        30.0,
        np.random.default_rng(0),
    )
    assert far.stopped == "no contact"


def test_the_lift_is_decided_by_where_the_orange_lies_and_by_friction():
    grip = pressing(Grip(), 1.8)
    assert lift(grip, 0.0).held and lift(grip, 0.0015).held
    assert not lift(grip, 0.004).held and not lift(grip, -0.004).held
    assert not lift(replace(grip, friction=0.1), 0.0).held
    assert not lift(replace(grip, mass=0.12), 0.0).held
    # Friction at two pads carries 0.06 kg from 1.47 N on.
    assert not lift(pressing(Grip(), 1.44), 0.0).held and lift(pressing(Grip(), 1.5), 0.0).held


def small(monkeypatch):
    """Make a study one of two places with a single lift."""
    monkeypatch.setattr("tacdata.grasping.study.PLACES", (-5.0, 1.0))
    monkeypatch.setattr("tacdata.grasping.study.EDGE", (1,))
    monkeypatch.setattr("tacdata.grasping.result.OTHER_FORCES", ())
    monkeypatch.setattr("tacdata.grasping.result._lifting", lambda grip: {"squeeze": 1.0, "holds_to": 2.5})


def test_a_small_study_is_a_valid_document_and_the_same_again(presses, sensor, tmp_path, monkeypatch):
    small(monkeypatch)
    setup = Setup(repeats=1, protocol=Protocol(window=0.2))
    maps = nearest_maps(presses, sensor)
    found, again = (result.result(setup, presses, sensor, maps, {"hash": "none"}) for _ in range(2))
    documents.check(json.loads(json.dumps(found)), "grasp_study", "here")
    assert found["trials"] == again["trials"]
    # Wilson's upper bound of no success: z^2 / (n + z^2), z^2 = 3.841459.
    assert found["rates"]["contact_only"]["edge"] == {"held": 0, "of": 1, "wilson_95": [0.0, pytest.approx(0.793451)]}
    left = {trial["strategy"]: abs(trial["left_at"]) for trial in found["trials"] if trial["position"] == 1}
    assert left["contact_only"] > 4.4
    assert left["dense_depth"] < 3
    assert any("paper" in line for line in result.lines(found))
    picture.save(found, tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 20_000


OWN = '''
"""The strongest taxel alone."""

from tacdata.grasping.strategies.strategy import Strategy


class StrongestTaxel(Strategy):
    """Goes by one taxel."""

    def centre(self, frames):
        mean = frames.mean(axis=0)
        return self.sensor.taxels.centers[mean.argmax()] if mean.max() > 100 else None
'''


def test_a_strategy_of_ones_own_is_one_file(presses, sensor, tmp_path, monkeypatch):
    import tacdata.grasping.strategies as room

    assert strategy_names()[:3] == ["contact_only", "raw_taxel", "dense_depth"]
    assert sorted(strategy_names()) == strategies.names()
    (tmp_path / "strongest_taxel.py").write_text(OWN)
    monkeypatch.setattr(room, "__path__", [*room.__path__, str(tmp_path)])
    small(monkeypatch)
    try:
        setup = Setup(repeats=1, protocol=Protocol(window=0.2))
        found = result.result(setup, presses, sensor, nearest_maps(presses, sensor), {"hash": "none"})
    finally:
        sys.modules.pop("tacdata.grasping.strategies.strongest_taxel", None)
    documents.check(json.loads(json.dumps(found)), "grasp_study", "here")
    assert "strongest_taxel" in list(found["rates"])[3:] and found["rates"]["strongest_taxel"]["overall"]["of"] == 2
    curve = found["bias"]["strongest_taxel"]
    assert set(curve) <= {*sensor.taxels.centers[:, 0].tolist(), None} and len(set(curve)) > 2
    assert any(line.startswith("strongest_taxel") for line in result.lines(found))
    picture.save(found, tmp_path / "study.png")


def test_presses_of_another_sensor_and_damaged_ones_are_refused(sensor, tmp_path):
    with pytest.raises(FormatError, match="another sensor"):
        read_presses(FOLDER / "orange.npz", default_sensor())
    (tmp_path / "cut.npz").write_bytes((FOLDER / "orange.npz").read_bytes()[:5000])
    with pytest.raises(FormatError, match=r"cut\.npz"):
        read_presses(tmp_path / "cut.npz", sensor)
