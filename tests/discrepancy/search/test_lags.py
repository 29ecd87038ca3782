"""Delays, filters and lags: which of them there is, and whether there are two."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.elimination import parsimonious, two_lags
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.effects import Placed, load

LAGS = ("latency", "latency_either_way", "low_pass_filter", "servo_lag", "servo_lag_overshoots")


def fitted(made, name, **values):
    """Return the setting, the null model, and a model with one lag."""
    response = FittedResponse(made)
    setting = Setting(made, response, [load(n) for n in LAGS])
    one = Placed(load(name), {k: np.array(v) for k, v in values.items()})
    null = null_model(replace(setting, given=(one,)))
    return setting, null, refine(setting, [one], null)


@pytest.mark.parametrize(("recovery", "left"), [(None, "latency"), (0.1, "latency_either_way")])
def test_two_delays_are_one_unless_presses_tell_them_apart(recovery, left):
    setting, null, model = fitted(course(delay=0.05, recovery=recovery), "latency_either_way", L_in=0.05, L_out=0.06)
    (found,) = parsimonious(setting, model, null, {}).placed
    assert found.effect.name == left
    assert found.effect.delay(found.values) == pytest.approx(0.05 if recovery is None else 0.075, abs=0.01)


@pytest.mark.parametrize(
    ("delay", "lag", "found", "open_too"),
    [
        (0.05, 0.0, {"latency"}, False),
        (0.0, 0.05, {"low_pass_filter"}, False),
        (0.1, 0.03, {"latency", "low_pass_filter"}, False),
        (0.06, 0.06, {"latency", "low_pass_filter"}, False),
        (0.1, 0.02, {"latency", "low_pass_filter"}, False),
        (0.015, 0.1, {"low_pass_filter"}, True),
    ],
)
def test_a_second_lag_is_there_where_no_single_one_explains_the_presses(delay, lag, found, open_too):
    """Where a law may be off by what a second lag explains, which lags there are is open."""
    name, of = ("latency", "L") if delay > lag else ("low_pass_filter", "tau")
    setting, null, model = fitted(course(delay=delay, lag=lag), name, **{of: delay + lag})
    two, maybe = two_lags(setting, model, refine(setting, [], null), null, {})
    assert ({p.effect.name for p in two.placed}, maybe) == (found, open_too)
    if len(found) == 2:
        late = {p.effect.name: float(next(iter(p.values.values()))) for p in two.placed}
        assert late["latency"] == pytest.approx(delay, abs=0.015)
