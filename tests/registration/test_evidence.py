"""Before the first press one slow touch shows whether the skin begins where the registration states."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[1] / "simulation"))

from simulated_rig import ORIGIN, World

from tacdata.devices.grbl import Grbl
from tacdata.errors import DeviceError
from tacdata.registration.evidence import PROVED, difference_limit, prove_zero
from tacdata.rig import Registration
from tacdata.rig.rig import from_document

DEEPEST = 0.45
"""Depth that the touch alone may reach [mm]: the search's step, and the slow approach beyond it."""


@pytest.fixture
def shifted(tmp_path):
    """Makes a world whose rig file states a registration that lies so far above the skin [mm]."""
    made = []

    def world(shift, **entries):
        made.append(World(1, tmp_path / "session"))
        plain = made[-1].rig

        def rig(**controller):
            good = plain(**controller)
            document = {
                **good.document,
                "registration": {
                    **good.document["registration"],
                    "origin": [*ORIGIN[:2], ORIGIN[2] + shift],
                    "residual": 0.01,
                },
                "envelope": {"min": [-106.0, -76.5, -42.5], "max": [-86.0, -46.5, -15.0]},
                **entries,
            }
            return replace(from_document(document, "simulated"), clock=good.clock)

        made[-1].rig = rig
        return made[-1]

    yield world
    for one in made:
        one.end()


def depth(world):
    """Deepest place of the tip in the skin so far [mm]."""
    return ORIGIN[2] - min(row[3] for row in world.path)


@pytest.mark.parametrize("shift", [0.0, 0.02, -0.02])
def test_a_true_registration_is_proved(shifted, shift):
    world = shifted(shift)
    assert world.record(prove=prove_zero).remaining == ()
    words = world.said[0]
    assert words.startswith("zero proved by a touch: first contact")
    assert float(words.split()[7]) == pytest.approx(-1000 * shift, abs=10)


@pytest.mark.parametrize("shift", [-1.0, -0.3, -0.1, 0.1, 0.3, 1.0, 2.0])
def test_where_the_touch_contradicts_nothing_goes_deep(shifted, shift):
    world = shifted(shift)
    with pytest.raises(DeviceError, match="by the registration: nothing goes deeper") as raised:
        world.record(prove=prove_zero)
    assert depth(world) < DEEPEST
    assert world.position()[2] > ORIGIN[2] + 1.5, "it was lifted"
    assert "register again" in raised.value.remedy
    assert not list(world.folder.glob("*.mcap"))


@pytest.mark.parametrize("lost", [1.5, -1.5])
def test_a_machine_that_lost_its_zero_is_found_out_after_a_mistaken_yes(shifted, lost):
    world = shifted(0.0)
    world.record()
    world.reboot()
    world.folder = world.folder.with_name("session2")
    world.path.clear()
    world.controller.machine.error = np.array([0.0, 0.0, lost])  # it reports so much less than it stands at
    world.answer = lambda question: True
    with pytest.raises(DeviceError, match="nothing goes deeper"):
        world.record(prove=prove_zero)
    assert len(world.asked) == 1
    assert depth(world) < 1.1, "one step"


def test_a_loss_that_no_report_shows_is_found_by_the_touch(shifted):
    """Moved by hand while switched off: the controller reports the place where it was left."""
    world = shifted(0.0)
    world.record()
    world.reboot()
    world.folder = world.folder.with_name("session2")
    machine = world.controller.machine
    machine._move(machine.planner.target - [0.0, 0.0, 2.5], 5.0, world.clock.now_ns(), "Jog")
    world.schedule.run_for(3.0, world.bench)
    world.path.clear()
    machine.error = np.array([0.0, 0.0, -2.5])
    with pytest.raises(DeviceError, match="nothing goes deeper"):
        world.record(prove=prove_zero)
    assert not world.asked
    assert depth(world) < 1.1, "one step"


def test_a_board_that_does_not_answer_stops_the_way_down(shifted):
    world = shifted(0.0)
    world.board.inject_readings(lambda counts: np.round(9000 + np.random.default_rng().normal(0, 5, 24)))
    with pytest.raises(DeviceError, match="no channel answers down to machine height"):
        world.record(prove=prove_zero)
    assert depth(world) < DEEPEST


def test_the_touch_is_at_the_reference_place_of_the_rig_file(shifted):
    world = shifted(0.0, reference={"x": 4.0, "y": -2.0})
    sites = []
    plain = prove_zero

    def noted(rig, *more):
        result = plain(rig, *more)
        sites.append(rig.registration.to_sensor(np.array([result]))[0][:2])
        return result

    world.record(prove=noted)
    assert sites[0] == pytest.approx([4.0, -2.0], abs=0.02)


def test_a_new_session_after_homing_needs_no_touch(shifted, monkeypatch):
    world, settings = shifted(0.0), Grbl.settings
    monkeypatch.setattr(Grbl, "settings", lambda self: {**settings(self), "homed_at_opening": "yes"})
    world.record(prove=prove_zero)
    assert world.said == []


@pytest.mark.parametrize(
    ("entry", "tilt", "limit"),
    [
        ({"uncertainty": {"origin": [0.02, 0.02, 0.005]}}, (0.0, 0.0), PROVED + 0.015),
        ({"residual": 0.05}, (0.0, 0.0), PROVED + 0.15),
        ({}, (0.0, 0.0), PROVED + 0.15),
        ({"uncertainty": {"origin": [0.02, 0.02, 0.005]}}, (0.01, 0.0), PROVED + 0.055),
    ],
)
def test_the_limit_follows_what_the_registration_claims(entry, tilt, limit):
    assert difference_limit(Registration((0.0, 0.0, 0.0), 0.0, tilt), entry) == pytest.approx(limit)
