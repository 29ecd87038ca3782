"""Friction and drag with a size of their own: a damper with a clearance, a motor's current, a dashpot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tacdata.chain import Course, Tool
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.gauss_newton import Refined, refine
from tacdata.effects import Placed, load

STEP, STROKES = 0.01, (20.0, 35.0, 50.0)
STARTS = {
    "friction_clearance": {"F": [0.3], "b": 0.14, "w": 0.05, "p": 0.5},
    "seal_friction": {"F": [0.3], "w": 0.08, "p": 0.5},
    "effort_friction": {"F": [0.3], "c": 0.02},
    "drag": {"D": [0.3], "n": 1.0},
    "bouc_wen": {"a": 0.5, "w": 0.12},
    "viscosity": {"k": 0.05, "n": 0.6},
    "latency": {"L": 0.03},
}
"""Effect -> first values of its numbers."""


def cycles(law: Callable[[np.ndarray, np.ndarray], np.ndarray], unit: float = 1.0) -> Course:
    """Return 18 cycles of a machine at three strokes and two rates, with a law's force of depth and rate."""
    rng, parts = np.random.default_rng(0), []
    for k in range(18):
        stroke, rate = STROKES[k % 3], (0.5, 1.0)[k // 3 % 2]
        time = np.arange(0, 1 / rate, STEP)
        depth = 0.5 * stroke * (1 - np.cos(2 * np.pi * rate * time)) + 1.0
        force = law(depth, np.gradient(depth, STEP)) + 0.004 * rng.normal(size=len(time))
        parts.append((time, depth, unit * (force + 0.1 * depth / STROKES[-1])))
    count = [len(time) for time, *_ in parts]
    depth, episode = np.concatenate([d for _, d, _ in parts]), np.repeat(np.arange(18), count)
    return Course(
        time=np.concatenate([2.5 * k + time for k, (time, *_) in enumerate(parts)]),
        episode=episode,
        tip=np.column_stack([0 * depth, 0 * depth, depth]),
        tool=np.zeros(len(episode), dtype=int),
        readings=np.concatenate([f for *_, f in parts])[:, None],
        averaged=np.ones(len(episode)),
        session=np.zeros(18, dtype=int),
        site=np.zeros(18, dtype=int),
        tools=(Tool("rod", "unknown", float("nan")),),
        names=tuple(f"cycle {k}" for k in range(18)),
    )


def damper(depth: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return a band's force, stepped in time: it slips at 1, is stiff over 0.5 mm, and loose over 4 mm."""
    follower, force = depth[0] + 2.5, []
    for value in depth:
        follower = min(max(follower, value - 2.5), value + 2.5)
        off = value - follower
        force.append(np.sign(off) * min(max(abs(off) - 2.0, 0.0) / 0.5, 1.0))
    return np.array(force)


def band(depth: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the force of a band that lets go at once, is loose over 4 mm, and pulls tight slowly, then faster."""
    z, crossed, force = -1.0, 0.0, [-1.0]
    for step in np.diff(depth, prepend=depth[:1])[1:]:
        sign, room = (1.0, 4.0 - crossed) if step > 0 else (-1.0, crossed)
        if z * sign < 0:
            z = sign * min(z * sign + abs(step), 0.0)
        elif z == 0 and room > 0:
            crossed += sign * min(abs(step), room)
        else:
            z = sign * min(abs(z) + abs(step) * (0.3 + 2.2 * abs(z) * (1.3 - abs(z))) / 2.5, 1.0)
        force.append(z)
    return np.array(force)


def motor(depth: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return a motor's current for a friction of 0.3: nothing at rest."""
    return 0.3 * rate / (np.abs(rate) + 1.0)


def dashpot(depth: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return a drag of 0.01 a mm/s."""
    return 0.01 * rate


def fits(course: Course, names: tuple[str, ...] = tuple(STARTS)) -> tuple[dict[str, Refined], float]:
    """Return each effect at its optimum, and the range of the readings that its size is a share of."""
    setting = Setting(course, FittedResponse(course), [])
    null = null_model(setting)
    made = {}
    for name in names:
        values = {k: np.array(v) for k, v in STARTS[name].items()}
        made[name] = refine(setting, [Placed(load(name), values)], null, 8)
    return made, float(np.ptp(np.quantile(course.readings, [0.02, 0.98])))


@pytest.mark.parametrize(
    ("law", "name"), [(damper, "friction_clearance"), (motor, "effort_friction"), (dashpot, "drag")]
)
def test_each_law_leaves_a_third_of_every_other_at_most(law, name):
    made, _ = fits(cycles(law))
    others = {other: model.loss for other, model in made.items() if other != name}
    assert made[name].loss < min(others.values()) / 3, others


@pytest.mark.parametrize("drag", [0.0, 0.3])
@pytest.mark.parametrize("law", [damper, band])
def test_a_damper_has_its_friction_and_its_drag_whatever_its_turn(law, drag):
    """A turn of another shape would leave what resembles a drag, and take as much from the friction."""
    fastest = float(np.abs(cycles(dashpot).speed).max())
    course = cycles(lambda depth, rate: law(depth, rate) + drag * rate / fastest)
    setting = Setting(course, FittedResponse(course), [])
    first = [(name, STARTS[name]) for name in ("friction_clearance", "drag")]
    placed = [Placed(load(name), {k: np.array(v) for k, v in values.items()}) for name, values in first]
    friction, viscous = (p.values for p in refine(setting, placed, null_model(setting), 12).placed)
    swing = float(np.ptp(np.quantile(course.readings, [0.02, 0.98])))
    assert float(friction["F"][0]) * swing == pytest.approx(1.0, rel=0.1)
    assert float(viscous["D"][0]) * swing == pytest.approx(drag, abs=0.1)


def test_a_damper_has_its_clearance():
    made, swing = fits(cycles(damper), ("friction_clearance",))
    [found] = made["friction_clearance"].placed
    assert float(found.values["F"][0]) * swing == pytest.approx(1.0, rel=0.05)
    assert float(found.values["b"]) * 0.5 * STROKES[-1] == pytest.approx(4.0, rel=0.1)


def test_a_motor_and_a_dashpot_have_their_sizes():
    made, swing = fits(cycles(motor), ("effort_friction",))
    assert float(made["effort_friction"].placed[0].values["F"][0]) * swing == pytest.approx(0.3, rel=0.05)
    made, swing = fits(cycles(dashpot), ("drag",))
    [found] = made["drag"].placed
    fastest = float(np.abs(cycles(dashpot).speed).max())
    assert float(found.values["D"][0]) * swing / fastest == pytest.approx(0.01, rel=0.05)
    assert float(found.values["n"]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("unit", [1e-12, 1e6])
def test_the_unit_of_the_readings_changes_no_share(unit):
    name = "friction_clearance"
    one, other = (fits(cycles(damper, by), (name,))[0][name].placed[0].values for by in (1.0, unit))
    assert float(other["F"][0]) == pytest.approx(float(one["F"][0]), rel=0.01)
    assert float(other["b"]) == pytest.approx(float(one["b"]), rel=0.01)


def test_an_effort_of_many_channels_is_left_to_the_pattern_of_a_load():
    course = cycles(damper)
    many = replace(course, readings=np.repeat(course.readings, 9, axis=1))
    response = FittedResponse(many)
    assert load("friction_clearance").unjudgeable(many, response)
    assert not load("friction_clearance").unjudgeable(course, response)
