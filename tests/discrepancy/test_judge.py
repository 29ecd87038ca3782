"""What is missing is named when it can be, and only then."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from pressing import course

from tacdata import documents
from tacdata.discrepancy.data.sufficiency import shortcomings
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.conclusion import Certainty, Conclusion
from tacdata.discrepancy.report.document import document
from tacdata.discrepancy.report.judgement import concluded, open_course
from tacdata.discrepancy.report.residual_slices import slices
from tacdata.discrepancy.report.text import in_text
from tacdata.effects import load

FEW = ("latency", "low_pass_filter", "relaxation", "backlash", "proportional_hysteresis", "drift", "creep")
"""Effects tried in these tests: enough to be confused, few enough to be quick."""
NOT_LINEAR = pytest.mark.long("tacdata/discrepancy", reason="the form that has no power is fitted too")


@dataclass(frozen=True)
class Judged:
    """What is concluded from presses."""

    conclusion: Conclusion

    @property
    def status(self):
        return self.conclusion.status

    @property
    def names(self):
        return {e.placed.effect.called for e in self.conclusion.named}

    @property
    def told(self):
        effects = self.conclusion.effects
        return {name for e in effects for name in (e.placed.effect.called, *e.alternatives)}

    @property
    def written(self):
        before, after = self.conclusion.before, self.conclusion.after
        sliced = slices(before.problem), slices(after.problem)
        return document(self.conclusion, before.problem.setting.course, sliced, {})


def judged(effects=FEW, made=None, **world):
    made = course(**world) if made is None else made
    opened = open_course(made)
    return Judged(concluded(made, Setting(opened, FittedResponse(opened), [load(name) for name in effects])))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_missing_is_none(seed):
    assert judged(seed=seed).status == "none"


def test_a_delay_is_named_and_measured():
    answer = judged(delay=0.05)
    assert answer.status == "named"
    assert answer.names == {"latency"}
    assert answer.conclusion.effects[0].placed.values["L"] == pytest.approx(0.05, abs=0.006)


@pytest.mark.long("tacdata/discrepancy", reason="two delays and their rivals, refined in turn")
def test_a_delay_that_is_longer_on_the_way_out_is_named_and_both_times_are_measured():
    answer = judged(effects=(*FEW, "latency_either_way"), delay=0.04, recovery=0.2)
    assert answer.status == "named"
    assert answer.names == {"latency"}
    values = answer.conclusion.effects[0].placed.values
    assert (values["L_in"], values["L_out"]) == pytest.approx((0.04, 0.2), abs=0.01)


def test_relaxation_is_named_and_measured():
    answer = judged(relaxed=0.15, hold=4.0)
    assert answer.names == {"relaxation"}
    assert answer.status == "named"
    assert answer.conclusion.effects[0].placed.values["f"] == pytest.approx(0.15, rel=0.2)


@pytest.mark.parametrize("power", [1.0, pytest.param(0.67, marks=NOT_LINEAR)])
def test_relaxation_of_a_skin_that_the_tool_leaves_is_named_and_measured(power):
    """A free tool cannot pull, and readings need not be linear in load."""
    answer = judged(effects=(*FEW, "relaxation_read"), relaxed=0.15, hold=4.0, pulls=False, power=power)
    assert answer.names == {"relaxation"} and answer.status == "named"
    placed = answer.conclusion.effects[0].placed
    assert placed.effect.name == "relaxation_read"
    assert placed.values["f"] == pytest.approx(0.15, rel=0.1)
    assert placed.values["m"] == pytest.approx(power, abs=0.1)


@pytest.mark.parametrize("power", [1.0, pytest.param(1.5, marks=NOT_LINEAR)])
def test_friction_of_a_skin_that_forgets_it_in_the_air_is_named(power):
    """Elements that slip beyond three loads, whatever the rate; readings need not be linear in load."""
    answer = judged(effects=(*FEW, "hysteresis", "hysteresis_read", "relaxation_read"), friction=0.2, power=power)
    assert answer.names == {"hysteresis"} and answer.status == "named"
    # A power of load is told from friction in load: the form that has none fits far worse.
    assert power == 1.0 or answer.conclusion.effects[0].placed.effect.name == "hysteresis_read"


def test_one_rate_names_no_lag():
    answer = judged(delay=0.05, rates=(1.0,), hold=0.4)
    assert answer.status in ("ambiguous", "unknown")
    assert "backlash" in answer.told


@pytest.mark.long("tacdata/discrepancy", reason="a lag among rivals that one rate cannot tell apart")
def test_a_hold_names_a_lags_family_at_one_rate():
    """In a hold of 1.5 s readings catch up: play does not."""
    late = judged(effects=(*FEW, "servo_lag"), delay=0.05, rates=(1.0,))
    assert "delay and filtering" in {e.placed.effect.family.value for e in late.conclusion.named}
    assert "backlash" not in late.told


def test_an_effect_that_no_file_holds_is_not_named():
    answer = judged(effects=("drift", "backlash"), relaxed=0.2, hold=4.0)
    assert answer.conclusion.nothing < 0.05
    assert answer.status != "named"


def test_a_verdict_fits_its_schema_and_says_what_cannot_be_judged():
    answer = judged(effects=("latency", "gain", "backlash"), episodes=12, delay=0.05)
    written = answer.written
    documents.check(written, "verdict", "verdict")
    assert "gain" in written["unjudgeable"]
    assert written["limits"]["latency"] is not None
    assert "delay" in in_text(written)


def test_two_presses_unlike_all_others_are_no_effect_and_not_nothing():
    made = course()
    readings = made.readings.copy()
    odd = np.isin(made.episode, (0, 1))
    readings[odd] = 5000 + 0.7 * (readings[odd] - 5000)
    wrong = replace(made, readings=readings)
    answer = judged(made=wrong)
    assert answer.status == "unknown"
    assert not answer.names


def test_few_episodes_carry_no_verdict():
    answer = judged(effects=("latency", "backlash"), episodes=5, delay=0.05)
    written = answer.written
    assert written["status"] == "unknown"
    assert "5 presses" in written["why"]
    assert {e["status"] for e in written["effects"]} <= {"suspected"}, "no name by the back door"


def test_a_fitted_response_cannot_learn_history():
    made = course(relaxed=0.2, hold=4.0, noise=0.0)
    response = FittedResponse(made)
    left = made.reduced.readings - response.signal(response.load(made.tip, made.tool))[made.read]
    assert np.abs(left).max() > 0.1 * 0.2 * 800


def test_what_is_of_another_unit_or_stuck_is_said():
    made = course(episodes=12)
    metres = replace(made, tip=made.tip / 1000)
    assert any("is the depth in mm" in words for words in shortcomings(metres))
    readings = made.readings.copy()
    readings[made.episode % 3 == 0, 1] = 5000
    assert any("channel 1" in words and "stuck" in words for words in shortcomings(replace(made, readings=readings)))
    assert not any("stuck" in words or "in mm" in words for words in shortcomings(made))


@pytest.mark.long("tacdata/discrepancy", reason="a pair of effects, judged with one rate and with two")
def test_what_one_rate_cannot_split_has_no_name():
    effects = (*FEW, "servo_lag")
    answer = judged(effects=effects, rates=(1.0,), play=0.05, delay=0.1, hold=0.4)
    assert answer.status == "ambiguous"
    assert not [e for e in answer.conclusion.effects if e.certainty is Certainty.NAMED], "one rate leaves each open"
    assert {"latency", "backlash"} <= answer.told
    assert judged(effects=effects, play=0.05, delay=0.1).names == {"latency", "backlash"}, "two rates split them"
