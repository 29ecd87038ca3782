"""Two clocks that do not fit each other are questioned; a skin that relaxes, creeps or answers late is none."""

import numpy as np
import pytest
from sources import table

from tacdata.importing.pressing.clock_lag import lag_doubts
from tacdata.importing.streams import Stream

ROWS = table(presses=12)
TIME, DEPTH = ROWS[:, 0], ROWS[:, 1]


def streams(time, readings):
    ns = np.rint(time * 1e9).astype(np.int64)
    taxels = Stream("taxels", ns - ns.min(), readings, ("a", "b"), "pF", "shared")
    path = np.column_stack([0 * DEPTH, 0 * DEPTH, -DEPTH])
    position = Stream("position", np.rint(TIME * 1e9).astype(np.int64), path, ("x", "y", "z"), "mm", "shared")
    return taxels, position


@pytest.mark.parametrize(("rows", "words"), [(16, "come 0.8 s before"), (8, "come 0.4 s before"), (40, "before")])
def test_readings_before_the_motion_are_questioned(rows, words):
    (doubt,) = lag_doubts(*streams(TIME[: -rows or None], ROWS[rows:, 2:]))
    assert words in doubt and "offset" in doubt


@pytest.mark.parametrize("late", (0.6, 0.9))
def test_readings_far_behind_the_motion_are_questioned(late):
    readings = np.column_stack([np.interp(TIME - late, TIME, column) for column in ROWS[:, 2:].T])
    (doubt,) = lag_doubts(*streams(TIME, readings))
    assert f"come {late:g} s behind" in doubt


@pytest.mark.parametrize("ratio", (1.03, 0.97, 1.005))
def test_clocks_of_two_rates_are_questioned(ratio):
    (doubt,) = lag_doubts(*streams(TIME * ratio, ROWS[:, 2:]))
    assert "drift apart" in doubt and ("+" in doubt) == (ratio > 1)


def filtered(seconds, share):
    slow = np.zeros(len(DEPTH))
    for row in range(1, len(DEPTH)):
        slow[row] = slow[row - 1] + (DEPTH[row] - slow[row - 1]) * (1 - np.exp(-0.05 / seconds))
    return (1 - share) * DEPTH + share * slow


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("an elastic skin", DEPTH),
        ("a skin that relaxes by half", 1.5 * DEPTH - 0.5 * filtered(0.8, 1.0)),
        ("a foam that creeps", filtered(0.4, 1.0)),
        ("a filter of 80 ms", filtered(0.08, 1.0)),
        ("a skin that answers little", 1e-4 * DEPTH),
    ],
)
def test_a_skin_is_no_clock(name, answer):
    noise = np.random.default_rng(4).normal(0, 0.002, (len(DEPTH), 2))
    assert lag_doubts(*streams(TIME, 10 + answer[:, None] * [1.0, 0.6] + noise)) == (), name
