import re
from dataclasses import replace

import numpy as np
import pytest
from fake_sensor import GUESS, SENSOR, FakeSensor, put_down

from tacdata.errors import DeviceError
from tacdata.recording.onset import onset
from tacdata.registration import RegistrationSettings, register
from tacdata.registration.procedure import reference_taxels
from tacdata.registration.solution import fit_rigid_motion
from tacdata.registration.symmetric_center import symmetric_center
from tacdata.rig import Registration
from tacdata.virtual_rig.world.world import draw
from tacdata.virtual_rig.world.world import put_down as put_down_in_the_world

CORNERS = [(-4.75, -3.75), (4.75, -3.75), (4.75, 3.75), (-4.75, 3.75), (0.0, 0.0)]


@pytest.mark.parametrize(("seed", "power"), [(0, 1.5), (1, 1.0), (2, 2.0), (3, 1.3), (4, 1.5), (5, 1.7)])
def test_a_sensor_put_down_by_eye_is_found_within_what_is_claimed(seed, power):
    place = put_down(seed)
    found = register(FakeSensor(place, seed, power), SENSOR, GUESS, RegistrationSettings())
    got, sigma = found.registration, found.uncertainty
    for have, want, limit in zip(got.origin, place.origin, (0.1, 0.1, 0.02), strict=True):
        assert abs(have - want) < limit
    for have, want, u in zip(got.origin, place.origin, sigma["origin"], strict=True):
        assert abs(have - want) < 4 * u
    assert abs(got.yaw - place.yaw) < 4 * sigma["yaw"]
    assert np.abs(np.subtract(got.tilt, place.tilt)).max() < 4 * sigma["tilt"][0]
    # What counts in the end: where the tip would be at the corners of the array.
    for x, y in CORNERS:
        error = np.subtract(got.to_machine(x, y, 0.0), place.to_machine(x, y, 0.0))
        assert np.abs(error[:2]).max() < 0.1
        assert abs(error[2]) < 0.02


def test_the_claimed_uncertainties_are_neither_idle_nor_false():
    """Over many sensors the errors are about as large as claimed."""
    ratio = []
    for seed in range(20, 27):
        place = put_down(seed)
        found = register(FakeSensor(place, seed), SENSOR, GUESS, RegistrationSettings())
        error = np.subtract(found.registration.origin, place.origin)
        ratio.append(error / found.uncertainty["origin"])
    spread = np.sqrt((np.array(ratio) ** 2).mean(axis=0))
    assert (spread < 2.0).all(), spread
    assert (spread > 0.05).all(), spread


def test_the_indenter_never_goes_deeper_than_it_says():
    probe = FakeSensor(put_down(1), 1)
    settings = RegistrationSettings()
    register(probe, SENSOR, GUESS, settings)
    depth = probe.place.to_sensor(np.array(probe.path))[:, 2]
    assert depth.max() < settings.depth + 0.05
    limit = GUESS.origin[2] - settings.limit - settings.depth
    assert min(position[2] for position in probe.path) > limit


def test_travel_between_the_places_is_clear_of_the_skin():
    probe = FakeSensor(put_down(2), 2)
    register(probe, SENSOR, GUESS, RegistrationSettings())
    tip = probe.place.to_sensor(np.array(probe.path))
    sideways = np.linalg.norm(np.diff(tip[:, :2], axis=0), axis=1) > 0.2
    assert sideways.sum() > 50
    assert (tip[:-1, 2][sideways] < -0.1).all()
    assert (tip[1:, 2][sideways] < -0.1).all()


def refused(probe, settings=None):
    with pytest.raises(DeviceError) as caught:
        register(probe, SENSOR, GUESS, settings or RegistrationSettings())
    return caught.value


def test_a_sensor_out_of_reach_is_said_and_the_limit_kept():
    low = replace(GUESS, origin=(-96.0, -61.5, -40.0))
    probe = FakeSensor(low)
    error = refused(probe)
    assert "no channel answered" in error.given
    assert min(position[2] for position in probe.path) >= GUESS.origin[2] - 1.0 - 1e-9
    assert probe.position[2] > GUESS.origin[2], "left above the skin"


def test_a_search_that_begins_in_contact_is_said():
    high = replace(GUESS, origin=(-96.0, -61.5, -36.9))
    assert "answers already" in refused(FakeSensor(high)).given


def test_a_dead_taxel_is_named():
    taxel = reference_taxels(SENSOR)[1]
    assert f"taxel {taxel}" in refused(FakeSensor(GUESS, dead=(taxel,))).given
    others = RegistrationSettings(taxels=(6, 10, 14))
    register(FakeSensor(GUESS, dead=(taxel,)), SENSOR, GUESS, others)


def test_a_tilted_and_a_domed_sensor_are_refused():
    tilted = Registration(GUESS.origin, GUESS.yaw, (0.07, 0.0))
    found = re.search(r"tilted by ([\d.]+) deg", refused(FakeSensor(tilted)).given)
    assert float(found[1]) == pytest.approx(4.0, abs=0.05)
    assert "not flat" in refused(FakeSensor(GUESS, dome=-0.008)).given


def test_too_much_noise_is_said():
    error = refused(FakeSensor(GUESS, noise=400.0))
    assert "no channel answered" in error.given or "no clear onset" in error.given
    still = FakeSensor(GUESS, noise=0.0)
    assert "no channel changes" in refused(still).given


def test_another_pitch_than_the_sensor_files_is_noticed():
    other = replace(SENSOR, taxels=replace(SENSOR.taxels, pitch_x=2.1, pitch_y=2.76))
    with pytest.raises(DeviceError, match="times as far apart"):
        register(FakeSensor(GUESS), other, GUESS, RegistrationSettings())


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_the_onset_has_no_bias_of_a_threshold(power):
    rng = np.random.default_rng(3)
    height = np.arange(0.2, -0.14, -0.02)
    errors = []
    for _ in range(30):
        true = rng.uniform(-0.03, 0.08)
        answer = 250 * np.maximum(true - height, 0.0) ** power * 10**power / 10 + rng.normal(0, 1, len(height))
        found = onset(height, answer)
        errors.append(found.height - true)
        assert abs(errors[-1]) < 5 * np.hypot(found.uncertainty, found.model)
    assert abs(np.mean(errors)) < 0.006
    assert np.std(errors) < 0.012


def test_an_approach_with_one_wild_reading_is_not_moved():
    height = np.arange(0.2, -0.14, -0.02)
    answer = 300 * np.maximum(0.02 - height, 0.0) ** 1.5 * 3 + np.random.default_rng(0).normal(0, 1, len(height))
    wild = answer.copy()
    wild[4] += 40.0
    assert abs(onset(height, wild).height - onset(height, answer).height) < 0.006


def test_a_flat_answer_and_a_contact_before_the_beginning_give_no_onset():
    height = np.arange(0.2, -0.14, -0.02)
    assert onset(height, np.random.default_rng(0).normal(0, 1, len(height))) is None
    assert onset(height, 100 * (0.5 - height)) is None


def test_the_centre_of_a_bell_and_of_none():
    place = np.linspace(-2.6, 2.6, 9)
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(20):
        center = rng.uniform(-0.8, 0.8)
        found = symmetric_center(place, 400 * np.exp(-((place - center) ** 2) / 4) + rng.normal(0, 3, 9), 3.0)
        errors.append(found.place - center)
    assert np.std(errors) < 0.02
    assert symmetric_center(place, rng.normal(0, 3, 9), 3.0) is None
    assert symmetric_center(place, 100 * np.exp(place), 3.0) is None, "the line does not reach across"


def test_a_rigid_motion_is_found_exactly_without_noise():
    sensor = np.array([[-2.85, -1.25], [2.85, 1.25], [0.0, 1.25]])
    c, s = np.cos(0.05), np.sin(0.05)
    machine = sensor @ np.array([[c, s], [-s, c]]) + [10.0, -3.0]
    motion = fit_rigid_motion(sensor, machine, np.full((3, 2), 0.01))
    assert motion.shift == pytest.approx((10.0, -3.0), abs=1e-12)
    assert motion.yaw == pytest.approx(np.degrees(0.05), abs=1e-12)
    assert motion.scale == pytest.approx(1.0)
    assert motion.residual.max() < 1e-12


def test_a_tilted_registration_goes_there_and_back():
    place = Registration((-90.0, 12.0, -31.0), 40.0, (0.015, -0.02))
    rng = np.random.default_rng(2)
    tip = rng.uniform(-5, 5, (50, 3))
    machine = np.array([place.to_machine(*row) for row in tip.tolist()])
    np.testing.assert_allclose(place.to_sensor(machine), tip, atol=1e-12)
    assert place.to_machine(2.0, 0.0, 0.0)[2] == pytest.approx(-31.0 + 0.03)


def test_an_emulated_sensor_put_down_by_eye_is_within_reach_of_the_search():
    drawn = [put_down_in_the_world(seed, GUESS) for seed in range(60)]
    off = np.array([np.subtract(place.origin, GUESS.origin) for place in drawn])
    assert (np.abs(off) <= (0.7, 0.7, 0.5)).all()
    assert (off.std(axis=0) > (0.3, 0.3, 0.2)).all()
    assert max(abs(place.tilt[0]) for place in drawn) > 0.015
    assert draw(3, SENSOR, GUESS, rough=True).gain == draw(3, SENSOR, GUESS).gain, "the rest of the world is the same"
