"""What `tacdata check` reads from a session's presses: clean plans of any tools say nothing, planted faults are said.

The answers come from the virtual rig's world, which shares nothing with the fit that judges them.
"""

import numpy as np
import pytest

from tacdata.indenters import from_document
from tacdata.plans.shipped.training import USUAL, training_plan
from tacdata.plans.specimens import STANDARD
from tacdata.recording.check.channel_order import Answers, gain_steps, misplaced, silent
from tacdata.rig import Registration
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.world import World, draw

SENSOR = default_sensor()


def answers(presses, seed, tools=None):
    """Return a clean session of the training plan, with tools drawn at random unless named."""
    rng = np.random.default_rng(seed)
    names = tools or tuple(rng.choice(tuple(STANDARD), size=rng.integers(1, 7), replace=False))
    plan = training_plan(SENSOR, presses, seed, names)
    shapes = {name: from_document(document, name) for name, document in plan["indenters"].items()}
    world = World(draw(seed, SENSOR, Registration((0.0, 0.0, 0.0), 0.0)), SENSOR)
    noise = np.random.default_rng(seed)
    response = []
    for p in plan["presses"]:
        force = 0.85 * world.taxel_force(np.array([p["x"], p["y"], -p["depth"]]), shapes[p["indenter"]], p["yaw"])
        closure = (np.maximum(force, 0.0) / world.truth.protrusion) ** (2 / 3)
        closed = closure / (closure + world.truth.half_closure)
        response.append(np.array(world.truth.gain) * (1 / (1 - 0.8 * closed) - 1) + noise.normal(0, 2.0, 24))
    return Answers(
        np.array(response),
        np.array([(p["x"], p["y"]) for p in plan["presses"]]),
        np.array([f"{p['indenter']} {p['yaw']:g}" for p in plan["presses"]]),
        np.full(24, 5.0),
        SENSOR.taxels,
    )


def judged(found):
    return gain_steps(found), misplaced(found), silent(found)


@pytest.mark.parametrize(("presses", "seed"), [(24, 3), (60, 24), *((n, s) for n in (16, 24, 60) for s in range(6))])
def test_clean_presses_of_any_tools_say_nothing(presses, seed):
    # (24, 3) and (60, 24): tools that are not round, pressed in a row, once passed for a step of a gain.
    assert judged(answers(presses, seed)) == ({}, {}, [])


@pytest.mark.parametrize("seed", range(4))
def test_a_gain_that_steps_is_found_among_many_tools(seed):
    found = answers(60, seed)
    found.response[30:, 14] *= 0.4
    steps, moved, mute = judged(found)
    assert list(steps) == [14] and not moved and not mute
    first, factor = steps[14]
    assert abs(first - 30) <= 4 and abs(factor - 0.4) < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_neighbours_that_are_exchanged_are_found_among_many_tools(seed):
    found = answers(24, seed, USUAL)
    found.response[:, [8, 9]] = found.response[:, [9, 8]]
    assert misplaced(found) == {8: 9, 9: 8}
