"""Load under a sphere that stays where it is relaxes as Hu et al. (2010) say, slower under a larger one."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.chain import State
from tacdata.effects import load


def held(loads, force, course):
    """A state of the mechanics alone."""
    none = np.empty((len(force), 0))
    return State(course, None, np.zeros((len(force), 3)), loads, force, none)


@pytest.mark.parametrize(("tool", "slower"), [(0, 2 / 3), (1, 4 / 3)])
def test_a_held_load_relaxes_as_a_gel_under_a_sphere(tool, slower):
    time = np.concatenate([[0.0, 1e-9], np.logspace(-3, 2.5, 400)])  # at once, then held
    one = np.where(time > 0, 1.0, 0.0)
    course = SimpleNamespace(
        tool=np.full(len(time), tool),
        step=np.diff(time, prepend=0.0),
        tools=(SimpleNamespace(radius=2.0), SimpleNamespace(radius=4.0)),
    )
    after = load("poroelasticity").apply(
        held(one[:, None], 5 * one, course), {"f": np.array(0.3), "tau": np.array(4.0)}
    )
    root = np.sqrt(time / (4.0 * slower))
    wanted = 1 - 0.3 * (1 - 0.491 * np.exp(-0.908 * root) - 0.509 * np.exp(-1.679 * root**2))
    assert after.load[2:, 0] == pytest.approx(wanted[2:], abs=0.3 * 0.015)
    assert after.force == pytest.approx(5 * after.load[:, 0])
    assert after.load[-1, 0] == pytest.approx(0.7, abs=1e-3)


def test_what_one_tool_pressed_out_comes_back_while_another_presses():
    time = np.linspace(0.0, 40.0, 4001)
    one = np.where(time < 10.0, 1.0, 0.0)  # the first tool presses, then the second hovers
    tool = (time >= 10.0).astype(int)

    def after(radii):
        tools = tuple(SimpleNamespace(radius=radius) for radius in radii)
        course = SimpleNamespace(tool=tool, step=np.diff(time, prepend=0.0), tools=tools)
        values = {"f": np.array(0.3), "tau": np.array(4.0)}
        return load("poroelasticity").apply(held(one[:, None], one, course), values).load[:, 0]

    same, larger = after((2.0, 2.0)), after((2.0, 4.0))
    alone = (
        load("poroelasticity")
        .apply(
            held(
                one[:, None],
                one,
                SimpleNamespace(tool=0 * tool, step=np.diff(time, prepend=0.0), tools=(SimpleNamespace(radius=2.0),)),
            ),
            {"f": np.array(0.3), "tau": np.array(4.0)},
        )
        .load[:, 0]
    )
    assert same == pytest.approx(alone)  # which of two equal tools it is makes no difference
    assert larger[1100] < -0.05  # a second after, the skin is still pressed in
    assert larger[-1] == pytest.approx(0.0, abs=0.05 * abs(larger[1100]))
