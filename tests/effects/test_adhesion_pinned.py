"""A contact that stays as wide as it was until it peels: the equations of Johnson, Kendall and Roberts."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.chain import Course, State, Tool
from tacdata.effects import load

MODULUS, RADIUS, WORK, TOP = 0.5, 4.0, 0.003, 1.0
STICKS = load("adhesion_pinned")


def pushed(pose, tool):
    """Hertz: the force of a ball on a half space."""
    return 4 / 3 * MODULUS * np.sqrt(RADIUS) * np.maximum(pose[:, 2], 0.0) ** 1.5


def pressed(depth, work=WORK):
    """Return the force of a ball that goes to depths, one after the other."""
    pose = np.column_stack([0 * depth, 0 * depth, depth])
    course = SimpleNamespace(tool=np.zeros(len(depth), int), span=TOP, first=np.arange(len(depth)) == 0)
    response = SimpleNamespace(force=pushed, load=lambda pose, tool: pushed(pose, tool)[:, None] * [1.0, 0.3])
    force = pushed(pose, None)
    state = State(course, response, pose, force[:, None] * [1.0, 0.3], force, np.empty(0))
    size = 2 * np.pi * work * np.sqrt(RADIUS * TOP) / MODULUS / TOP**2
    after = STICKS.apply(state, {"a": np.array(size)})
    assert after.load == pytest.approx(after.force[:, None] * [1.0, 0.3], abs=1e-9)
    return after.force


def peeled(depth):
    """The equilibrium of JKR, by the radius of the contact."""
    wide = np.linspace(0.05, np.sqrt(RADIUS * TOP), 4000)
    below = wide**2 / RADIUS - np.sqrt(2 * np.pi * WORK * wide / MODULUS)
    force = 4 * MODULUS * wide**3 / 3 / RADIUS - np.sqrt(8 * np.pi * WORK * MODULUS * wide**3)
    first = int(np.argmin(below))
    return np.where(depth < below[first], 0.0, np.interp(depth, below[first:], force[first:]))


def test_it_comes_back_along_a_flat_punch_and_then_along_jkr():
    down, up = np.linspace(-0.3, TOP, 300), np.linspace(TOP, -0.3, 400)
    force = pressed(np.concatenate([down, up]))
    assert force[:300] == pytest.approx(pushed(np.column_stack([down] * 3), None), abs=1e-9)
    punch = force[299] - 2 * MODULUS * np.sqrt(RADIUS * TOP) * (TOP - up)
    assert force[300:] == pytest.approx(np.maximum(punch, peeled(up)), abs=1e-3)
    assert force.min() == pytest.approx(peeled(up).min(), rel=0.01), "it pulls before it lets go"


def test_pressed_again_before_it_lets_go_it_follows_the_same_line():
    back = np.linspace(TOP, 0.9, 50)
    force = pressed(np.concatenate([np.linspace(-0.3, TOP, 300), back, back[::-1]]))
    assert force[350:] == pytest.approx(force[300:350][::-1], abs=1e-9)


def test_without_readings_above_the_touch_nothing_tells_it_from_friction():
    away = np.array([0.0, 1.0, 0.0])
    course = Course(
        time=np.arange(3.0),
        episode=np.zeros(3, int),
        tip=np.column_stack([away, away, away]),
        tool=np.zeros(3, int),
        readings=np.zeros((3, 1)),
        averaged=np.ones(3),
        session=np.zeros(1, int),
        site=np.zeros(1, int),
        tools=(Tool("ball", "sphere", 4.0),),
        names=("press",),
    )
    assert "friction" in STICKS.unjudgeable(course, None)
    course.tip[-1, 2] = -0.1
    course = Course(**{name: getattr(course, name) for name in course.__dataclass_fields__})
    assert not STICKS.unjudgeable(course, None)
