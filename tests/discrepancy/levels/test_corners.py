"""An effect of one place or one rate is found there; one of the whole machine has no corner."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.tip_motion import speeds
from tacdata.discrepancy.levels.corners import corner
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.gate import gate
from tacdata.discrepancy.search.problem import prepare
from tacdata.effects import load

LAWS = ("latency", "low_pass_filter", "relaxation", "creep", "dry_friction")


def late(by, where):
    """Return the problem of presses whose readings are late by some seconds in a part of the rows."""
    made = course(seed=3, episodes=32)
    values, rows = made.readings.copy(), where(made)
    for e in range(made.episodes):
        at = made.read[made.episode[made.read] == e]
        for k, own in enumerate(made.readings[at].T):
            values[at, k] = np.where(rows[at], np.round(np.interp(made.time[at] - by, made.time[at], own)), own)
    made = replace(made, readings=values)
    setting = Setting(made, FittedResponse(made), [load(name) for name in LAWS])
    return prepare(setting, null_model(setting))


def fast(made):
    """Return the rows of presses at the faster rate, shape (rows,), bool."""
    return (speeds(made)[0] > 1)[made.episode]


def deep(made):
    """Return the deepest third of the rows in contact, shape (rows,), bool."""
    depth = made.tip[:, 2]
    return depth > np.quantile(depth[depth > 0], 2 / 3)


@pytest.mark.parametrize(
    ("where", "words"),
    [
        (lambda made: made.row_site == 1, "at (1, 0) mm"),
        (fast, "presses at 2 mm/s"),
        (lambda made: fast(made) & (made.row_site == 0), "presses at 2 mm/s, at (0, 0) mm"),
        (deep, "deep (0.6 to 1 mm)"),
        (lambda made: fast(made) & deep(made), "deep (0.6 to 1 mm), presses at 2 mm/s"),
    ],
)
def test_a_delay_of_one_corner_is_found_there(where, words):
    found = corner(late(0.03, where))
    assert found is not None and found.words == words
    assert found.placed.effect.called in ("latency", "low_pass_filter")
    assert found.alarm.seen.startswith(f"in one corner alone, {words}: readings change as by")


@pytest.mark.parametrize("by", [0.0, 0.03])
def test_what_is_everywhere_or_nowhere_has_no_corner(by):
    problem = late(by, lambda made: np.ones(made.rows, dtype=bool))
    assert gate(problem).gap == (by > 0)
    assert corner(problem) is None
