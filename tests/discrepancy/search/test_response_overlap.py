"""What a further effect does that what is there could do in another form, and what it does that it could not."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.candidates import StandIn
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.discrepancy.search.overlap import overlap
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.search.race import model_error_energy
from tacdata.effects import Placed, load


@pytest.fixture(scope="module")
def late():
    plain = course(delay=0.05)
    own = 1 + 0.02 * np.random.default_rng(0).normal(size=plain.episodes)  # else presses tell small gains surely
    made = replace(plain, readings=5000 + own[plain.episode][:, None] * (plain.readings - 5000))
    others = [load(name) for name in ("low_pass_filter", "relaxation", "gain_drift")]
    setting = Setting(made, FittedResponse(made), others)
    model = refine(setting, [Placed(load("latency"), {"L": np.array(0.05)})], null_model(setting))
    return prepare(Setting(made, model.response, others), null_model(setting), model.placed)


def of(problem, name):
    return [c for c in problem.candidates if c.effect.name == name]


def test_another_form_of_what_is_there_could_be_said_by_it(late):
    shares = {name: overlap(late, of(late, name)) for name in ("low_pass_filter", "relaxation", "gain_drift")}
    assert shares["low_pass_filter"] > 0.8
    assert shares["gain_drift"] < 0.2
    assert shares["gain_drift"] < shares["relaxation"] < 1.0
    assert overlap(late, []) == 0.0


def test_what_is_unlike_a_large_effect_needs_to_explain_less(late):
    """One part in a hundred of a large effect's energy was asked for, whatever that looked like."""
    there = [(load("latency"), 10000.0)]
    table, fitted = StandIn(False), late.setting.response
    whole, alike = (model_error_energy(there, [load("gain_drift")], table, known) for known in (None, late))
    assert alike == pytest.approx(whole * overlap(late, of(late, "gain_drift")))
    assert alike < 0.2 * whole
    assert model_error_energy(there, [load("gain_drift")], fitted, late) > 200.0, "what a fitted response makes of it"
