"""A gain of whole readings shows in readings at rest, and is told there from offsets."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.chain.at_rest import told_at_rest
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import load

FEW = ("gain_drift_whole", "gain_drift", "settling_gain", "drift", "warm_up_drift", "permanent_set", "thermal_growth")


def at_rest(levels, seed=0):
    """Presses of which channels read other levels without contact."""
    made = course(seed=seed, episodes=36)
    return replace(made, readings=made.readings - 5000 + np.array(levels))


def named(made):
    setting = Setting(made, FittedResponse(made), [load(name) for name in FEW])
    return {e.placed.effect.called: e.placed for e in concluded(made, setting).named}


def warmed(made, by, tau):
    fall = 1 - by * -np.expm1(-made.time / tau)
    return replace(made, readings=made.readings * fall[:, None])


def test_magnets_that_warm_up_are_a_gain_and_no_dent():
    made = named(warmed(at_rest([2000.0, -900.0, 100.0]), 0.08, 60.0))
    assert set(made) == {"gain_drift"}
    placed = made["gain_drift"]
    assert placed.effect.name == "gain_drift_whole"
    assert float(placed.values["k"]) == pytest.approx(-0.08, rel=0.1)


def test_offsets_that_each_drift_their_own_way_are_no_gain():
    made = at_rest([2000.0, -900.0, 100.0])
    clock = (made.time / made.time[-1])[:, None]
    assert "gain_drift" not in named(replace(made, readings=made.readings + clock * [-20.0, -40.0, 60.0]))


@pytest.mark.parametrize(("levels", "why"), [([0.0, 0.0, 3.0], "zero"), ([5000.0, 5010.0, 5000.0], "alike")])
def test_readings_that_say_nothing_at_rest_are_not_asked(levels, why):
    idle, words = told_at_rest(at_rest(levels))
    assert idle is None
    assert why in words


def test_what_each_channel_reads_at_rest():
    idle, words = told_at_rest(at_rest([2000.0, -900.0, 100.0]))
    assert idle == pytest.approx([2000.0, -900.0, 100.0], abs=5)
    assert not words
