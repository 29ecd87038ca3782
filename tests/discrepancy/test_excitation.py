"""Which ways of pressing can tell mechanisms of rate apart."""

from dataclasses import replace

import numpy as np
from pressing import course

from tacdata.discrepancy.excitation import inseparable, one_rate


def test_two_rates_of_pressing_are_told_from_one():
    assert one_rate(course(rates=(1.0,)))
    assert not one_rate(course(rates=(0.5, 2.0)))
    assert inseparable(course(rates=(0.5, 2.0)), "backlash") == ()
    assert "latency" in inseparable(course(rates=(1.0,)), "backlash")


def test_the_way_to_the_skin_does_not_count_as_pressing():
    """Half of the episodes come ten times as fast, or all: what presses is as it was."""
    for pressed, same in (((1.0,), True), ((0.5, 2.0), False)):
        made = course(rates=pressed)
        for fast in (made.episode % 2 == 0, made.episode >= 0):
            tip = made.tip.copy()
            tip[fast & (tip[:, 2] < 0), 2] *= 10
            assert one_rate(replace(made, tip=tip)) == same


def test_a_session_that_never_touches_has_one_rate():
    made = course()
    assert one_rate(replace(made, tip=made.tip - np.array([0, 0, 5.0])))
