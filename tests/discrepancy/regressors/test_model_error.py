"""A large effect whose equation is a little wrong is no evidence of a small one."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.chain import predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.model_error import model_errors, modulations, variants
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.effects import Placed, load


@pytest.fixture(scope="module")
def pressed():
    made = course(delay=0.05)
    return made, FittedResponse(made, 14), Placed(load("latency"), {"L": np.array(0.05)})


def most_gained(problem):
    """Return the largest fall of half the sum of squares by one column of a candidate."""
    gram = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(1e-6)).sum(axis=0)
    columns = np.concatenate([c.columns for c in problem.candidates]) + 1
    return float(np.max(0.5 * gram[columns, 0] ** 2 / np.maximum(gram[columns, columns], 1e-9)))


def test_modulations_are_of_size_one_and_leave_the_contribution_itself(pressed):
    made, response, late = pressed
    streams = Streams.of(made)
    own = streams.predicted(predict(made, response, [late])) - streams.predicted(predict(made, response, []))
    weight = np.sum(own**2)
    for by in modulations(made, streams, own):
        changed = own * by
        assert np.sum(changed**2) == pytest.approx(weight, rel=1e-6)
        assert abs(np.sum(changed * own)) < 1e-6 * weight


def test_columns_are_a_share_of_each_effect(pressed):
    made, response, late = pressed
    assert model_errors(made, response, []).values.shape[2] == 0
    one = model_errors(made, response, [late]).values
    assert one.shape == (len(made.read), 3, 5 + 2), "a delay of several sizes is a filter"
    twice = model_errors(made, response, [replace(late, values={"L": np.array(0.1)})]).values
    size = np.linalg.norm(twice, axis=(0, 1)) / np.linalg.norm(one, axis=(0, 1))
    assert np.all((size > 1.7) & (size < 2.1))


def test_a_clock_is_known_better_than_a_law_of_a_material(pressed):
    made, response, _ = pressed
    streams = Streams.of(made)
    for name, value, share in (("latency", {"L": np.array(0.05)}, 0.02), ("relaxation", {}, 0.1)):
        effect = load(name)
        given = {p.name: np.array(p.default + p.typical) for p in effect.parameters} | value
        placed = Placed(effect, given)
        own = streams.predicted(predict(made, response, [placed])) - streams.predicted(predict(made, response, []))
        by = np.linalg.norm(model_errors(made, response, [placed]).values[:, :, :5], axis=(0, 1)) / np.linalg.norm(own)
        assert by == pytest.approx(np.full(5, share), rel=1e-3)


def test_a_mechanism_may_have_any_of_its_forms_and_shapes(pressed):
    made = pressed[0]
    counts = {}
    for name in ("relaxation", "proportional_hysteresis", "low_pass_filter", "crosstalk"):
        effect = load(name)
        given = {p.name: np.array(p.default + p.typical) for p in effect.parameters}
        found = variants(Placed(effect, given), made.channels)
        counts[name] = {other.effect.name: 0 for other in found}
        for other in found:
            counts[name][other.effect.name] += 1
    # Beside the grid, half and twice its own time constant.
    assert counts["relaxation"] == {
        "relaxation": 10,
        "relaxation_let_go": 8,
        "relaxation_read": 12,
        "power_creep": 3,
        "power_creep_let_go": 3,
        "power_creep_read": 9,
        "nonlinear_relaxation": 4,
    }
    assert counts["proportional_hysteresis"] == {
        "proportional_hysteresis": 5,
        "hysteresis": 1,
        "bouc_wen": 3,
        "hysteresis_read": 6,
        "hysteresis_apart": 4,
    }
    assert counts["low_pass_filter"] == {"low_pass_filter": 4}
    wide = Placed(load("low_pass_filter"), {"tau": np.array(1.0)})
    assert [float(v.values["tau"]) for v in variants(wide, 3)] == [0.25, 0.5, 2.0, 2.0], "within its bounds"


def test_what_a_wrong_form_leaves_is_no_second_effect(pressed, monkeypatch):
    """Latency, known as a material is, that is a tenth larger while unloading: others are seen in what it leaves."""
    made, response, late = pressed
    monkeypatch.setattr(type(late.effect), "form_error", 0.1)
    streams = Streams.of(made)
    own = streams.predicted(predict(made, response, [late])) - streams.predicted(predict(made, response, []))
    readings = made.readings.copy()
    readings[made.read] += 0.1 * own * np.sign(made.speed)[made.read][:, None]
    wrong = replace(made, readings=readings)
    few = [load(name) for name in ("backlash", "relaxation", "proportional_hysteresis", "creep")]
    setting = Setting(wrong, response, few)
    problem = prepare(setting, null_model(replace(setting, given=(late,))), [late])
    slack = most_gained(problem)
    bare = most_gained(replace(problem, model_errors=np.zeros(0, dtype=int)))
    assert bare > 20
    assert slack < 0.3 * bare


def test_a_spectrum_of_time_constants_is_no_second_memory():
    """Relaxation over 0.4 and 10 s beside one time constant of 2 s: other memories are seen in what that leaves."""
    made = course()
    response, streams, effect = FittedResponse(made, 14), Streams.of(made), load("relaxation")

    def relaxed(share, tau):
        return Placed(effect, {"f": np.array(share), "tau": np.array(tau)})

    one = relaxed(0.2, 2.0)
    truth = predict(made, response, [relaxed(0.1, 0.4), relaxed(0.1, 10.0)])
    readings = made.readings.copy()
    apart = streams.predicted(truth) - streams.predicted(predict(made, response, []))
    readings[made.read] += apart[:, : made.channels]
    few = [load(name) for name in ("backlash", "creep", "baseline_tracking", "proportional_hysteresis")]
    setting = Setting(replace(made, readings=readings), response, few)
    problem = prepare(setting, null_model(replace(setting, given=(one,))), [one])
    narrow = most_gained(replace(problem, model_errors=problem.model_errors[:5]))
    spread = most_gained(problem)
    assert narrow > 20
    assert spread < 0.1 * narrow


def test_a_period_has_harmonics_of_any_phase():
    """A screw's second harmonic is its own, and no second effect; sine and cosine are varied each by itself."""
    screw = Placed(load("screw_error"), {"s": np.array(0.01), "c": np.array(0.0), "p": np.array(0.8)})
    half = [v.values for v in variants(screw, 3) if float(v.values["p"]) == 0.4]
    assert sorted((float(v["s"] > 0), float(v["c"] > 0)) for v in half) == [(0.0, 1.0), (1.0, 0.0)]
