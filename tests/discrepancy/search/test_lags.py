"""Lags are one where one explains the presses, and two where no single one does."""

import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.judgement import concluded, open_course
from tacdata.effects import load

LAGS = ("latency", "latency_either_way", "low_pass_filter", "servo_lag", "servo_lag_overshoots")


def concluded_of(**world):
    made = course(**world)
    opened = open_course(made)
    return concluded(made, Setting(opened, FittedResponse(opened), [load(name) for name in LAGS]))


@pytest.mark.parametrize(("recovery", "form"), [(None, "latency"), (0.2, "latency_either_way")])
def test_two_delays_are_one_unless_presses_tell_them_apart(recovery, form):
    conclusion = concluded_of(delay=0.05, recovery=recovery)
    (one,) = conclusion.named
    assert one.placed.effect.name == form
    assert one.placed.effect.delay(one.placed.values) == pytest.approx(0.05 if recovery is None else 0.125, abs=0.01)


@pytest.mark.parametrize(
    ("delay", "lag", "found"),
    [
        (0.0, 0.05, {"low_pass_filter"}),
        (0.1, 0.03, {"latency", "low_pass_filter"}),
        (0.06, 0.06, {"latency", "low_pass_filter"}),
    ],
)
def test_a_second_lag_is_named_where_no_single_one_explains_the_presses(delay, lag, found):
    conclusion = concluded_of(delay=delay, lag=lag)
    assert {e.placed.effect.name for e in conclusion.named} == found
    if len(found) == 2:
        late = {e.placed.effect.name: float(next(iter(e.placed.values.values()))) for e in conclusion.named}
        assert late["latency"] == pytest.approx(delay, abs=0.015)
