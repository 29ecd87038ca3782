"""The world's own skin."""

import time

import numpy as np
import pytest

from tacdata.indenters import from_document
from tacdata.rig import Registration
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.world import World, draw

SENSOR = default_sensor()
NOMINAL = Registration((-96.0, -61.5, -38.0), 1.2)
SPHERE = from_document({"shape": "sphere", "radius": 4.0})
S = 1_000_000_000


@pytest.fixture
def world():
    return World(draw(5, SENSOR, NOMINAL), SENSOR)


def tip(world, x, y, depth):
    return np.array(world.truth.registration.to_machine(x, y, depth))


def settled(world, position, indenter=SPHERE, begin=0, frames=60):
    rows = [world.readings(position, indenter, 0.0, begin + k * S // 30) for k in range(frames)]
    return np.mean(rows[-20:], axis=0) - world.truth.offset


def test_without_contact_only_noise(world):
    rows = np.array([world.readings(tip(world, 0, 0, -1.0), SPHERE, 0.0, k * S // 30) for k in range(600)])
    spread = rows.std(axis=0)
    assert np.abs(rows.mean(axis=0) - world.truth.offset).max() < 4 * world.truth.drift
    assert 0.8 * world.truth.noise < np.median(spread) < 1.6 * world.truth.noise
    assert np.array_equal(rows, np.round(rows))


def test_nothing_mounted_is_no_contact(world):
    assert np.abs(settled(world, tip(world, 0, 0, 1.0), None)).max() < 4 * world.truth.drift


@pytest.mark.parametrize("taxel", [0, 8, 15, 23])
def test_deeper_press_gives_more_at_the_nearest_taxel(taxel):
    x, y = SENSOR.taxels.centers[taxel]
    responses = []
    for depth in (0.3, 0.6, 1.0, 1.5):
        world = World(draw(5, SENSOR, NOMINAL), SENSOR)
        response = settled(world, tip(world, x, y, depth)) / np.array(world.truth.gain)
        assert np.argmax(response) == taxel
        responses.append(response[taxel])
    assert np.all(np.diff(responses) > 0.01)


def test_response_moves_with_x(world):
    gain, x = np.array(world.truth.gain), SENSOR.taxels.centers[:, 0]
    centroids = []
    for k, place in enumerate((-3.0, -1.0, 1.0, 3.0)):
        response = settled(world, tip(world, place, 0.0, 0.8), begin=k * 600 * S) / gain
        centroids.append((response * x).sum() / response.sum())
    assert np.all(np.diff(centroids) > 0.8)


def test_hidden_registration_error_is_small_but_there():
    errors = []
    for seed in range(40):
        truth = draw(seed, SENSOR, NOMINAL)
        errors.append(np.subtract(truth.registration.origin, NOMINAL.origin))
    spread = np.std(errors, axis=0)
    assert np.all((spread > (0.03, 0.03, 0.012)) & (spread < (0.08, 0.08, 0.032)))
    assert np.abs(errors).max() < 0.3


def test_force_relaxes_in_a_hold_and_recovers(world):
    pressed, lifted = tip(world, 0, 0, 1.0), tip(world, 0, 0, -1.0)
    early = np.mean([world.readings(pressed, SPHERE, 0.0, k * S // 30).sum() for k in range(3)])
    for k in range(3, 600):
        world.readings(pressed, SPHERE, 0.0, k * S // 30)
    base = sum(world.truth.offset)
    late = world.readings(pressed, SPHERE, 0.0, 20 * S).sum() - base
    assert 0.75 < late / (early - base) < 0.95
    after = settled(world, lifted, begin=21 * S)
    assert np.abs(after).max() < 30
    world.readings(lifted, SPHERE, 0.0, 200 * S - S // 30)
    again = settled(world, pressed, begin=200 * S).sum()
    assert again > late


def test_relaxation_does_not_depend_on_the_frame_rate():
    final = []
    for rate in (30, 300):
        world = World(draw(5, SENSOR, NOMINAL), SENSOR)
        for k in range(2 * rate + 1):
            depth = min(k / rate, 1.0)
            force = world._relaxed(world.taxel_force(tip(world, 0, 0, depth), SPHERE, 0.0), k * S // rate)
        final.append(force.sum())
    assert final[0] == pytest.approx(final[1], rel=2e-3)


def test_same_seed_same_world_other_seed_another():
    assert draw(1, SENSOR, NOMINAL) == draw(1, SENSOR, NOMINAL)
    assert draw(1, SENSOR, NOMINAL).gain != draw(2, SENSOR, NOMINAL).gain


def test_readings_stay_within_the_converter(world):
    response = settled(world, tip(world, 0, 0, 3.2), from_document({"shape": "sphere", "radius": 8.0}))
    counts = response + world.truth.offset
    assert counts.max() < 65535
    assert response.max() > 5000


def test_fast_enough_for_240_frames_a_second(world):
    begun = time.process_time()
    for k in range(240):
        world.readings(tip(world, 0.01 * k, 0, 1.0), SPHERE, 0.0, k * S // 30)
    assert time.process_time() - begun < 1.0  # a core's whole second would be too much by far
