"""What is missing is named when it can be, and only then."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pressing import course
from threadpoolctl import threadpool_info

from tacdata import documents
from tacdata.discrepancy import judge
from tacdata.discrepancy.data.checks import DataChecks, check
from tacdata.discrepancy.data.sufficiency import shortcomings
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.search.find import find
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.race import without_minor
from tacdata.discrepancy.search.rivals import required_margin, stands_in
from tacdata.discrepancy.verdict.calibration import BEYOND, gains_beyond_calibration
from tacdata.discrepancy.verdict.decide import Decision, adequate, decide, settled
from tacdata.discrepancy.verdict.document import document
from tacdata.discrepancy.verdict.likelihood_ratio import LikelihoodRatio
from tacdata.discrepancy.verdict.reasons import reason_in_words
from tacdata.discrepancy.verdict.residual_slices import slices
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.discrepancy.verdict.text import in_text
from tacdata.effects import Placed, load

FEW = ("latency", "low_pass_filter", "relaxation", "backlash", "proportional_hysteresis", "drift", "creep")
"""Effects raced in these tests: enough to be confused, few enough to be quick."""
NOT_LINEAR = pytest.mark.long("tacdata/discrepancy", reason="the form that has no power is fitted too")


@dataclass(frozen=True)
class Judged:
    """What was found in presses, and what may be said of it."""

    found: Findings
    checks: DataChecks
    decision: Decision

    @property
    def names(self):
        return {e.finding.placed.effect.called for e in self.decision.effects}

    @property
    def written(self):
        sliced = slices(self.found.problem), slices(self.found.final)
        return document(self.decision, self.found, self.checks, sliced, {})


def judged(effects=FEW, made=None, **world):
    made = course(**world) if made is None else made
    setting = Setting(made, FittedResponse(made), [load(name) for name in effects])
    found, checks = find(setting), check(setting)
    return Judged(found, checks, decide(found, checks))


def sealed(power, share):
    """Return what four sealed episodes show of an answer, of a squared size of ``power``."""
    return Gap(*np.ones((3, 4)), tuple("abcd"), ratio=LikelihoodRatio(power, share))


def test_a_verdict_uses_one_thread_of_linear_algebra(monkeypatch):
    threads = []

    def chosen(course):
        threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        raise InterruptedError

    monkeypatch.setattr(judge, "chosen", chosen)
    with pytest.raises(InterruptedError):
        judge.judge(course(episodes=1), cast(Any, None))
    assert threads and set(threads) == {1}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_missing_is_none(seed):
    assert judged(seed=seed).decision.status == "none"


def test_a_delay_is_named_and_measured():
    answer = judged(delay=0.05)
    assert answer.decision.status == "named"
    assert answer.names == {"latency"}
    assert answer.found.effects[0].placed.values["L"] == pytest.approx(0.05, abs=0.006)


@pytest.mark.long("tacdata/discrepancy", reason="two delays and their rivals, refined in turn")
def test_a_delay_that_is_longer_on_the_way_out_is_named_and_both_times_are_measured():
    answer = judged(effects=(*FEW, "latency_either_way"), delay=0.04, recovery=0.2)
    assert answer.decision.status == "named"
    assert answer.names == {"latency"}
    values = answer.found.effects[0].placed.values
    assert (values["L_in"], values["L_out"]) == pytest.approx((0.04, 0.2), abs=0.01)


def test_relaxation_is_named_and_measured():
    answer = judged(relaxed=0.15, hold=4.0)
    assert answer.names == {"relaxation"}
    assert answer.decision.status == "named"
    assert answer.found.effects[0].placed.values["f"] == pytest.approx(0.15, rel=0.2)


@pytest.mark.parametrize("power", [1.0, pytest.param(0.67, marks=NOT_LINEAR)])
def test_relaxation_of_a_skin_that_the_tool_leaves_is_named_and_measured(power):
    """A free tool cannot pull, and readings need not be linear in load."""
    answer = judged(effects=(*FEW, "relaxation_read"), relaxed=0.15, hold=4.0, pulls=False, power=power)
    assert answer.names == {"relaxation"} and answer.decision.status == "named"
    placed = answer.found.effects[0].placed
    assert placed.effect.name == "relaxation_read"
    assert placed.values["f"] == pytest.approx(0.15, rel=0.1)
    assert placed.values["m"] == pytest.approx(power, abs=0.1)


@pytest.mark.parametrize("power", [1.0, pytest.param(1.5, marks=NOT_LINEAR)])
def test_friction_of_a_skin_that_forgets_it_in_the_air_is_named(power):
    """Elements that slip beyond three loads, whatever the rate; readings need not be linear in load."""
    answer = judged(effects=(*FEW, "hysteresis", "hysteresis_read", "relaxation_read"), friction=0.2, power=power)
    assert answer.names == {"hysteresis"} and answer.decision.status == "named"
    # A power of load is told from friction in load: the form that has none fits far worse.
    assert power == 1.0 or answer.found.effects[0].placed.effect.name == "hysteresis_read"


def test_one_rate_names_no_lag():
    answer = judged(delay=0.05, rates=(1.0,), hold=0.4)
    assert answer.decision.status in ("ambiguous", "unknown")
    assert "backlash" in answer.decision.effects[0].finding.rivals


@pytest.mark.long("tacdata/discrepancy", reason="a lag among rivals that one rate cannot tell apart")
def test_a_hold_names_a_lags_family_at_one_rate():
    """In a hold of 1.5 s readings catch up: play does not."""
    (decided,) = judged(effects=(*FEW, "servo_lag"), delay=0.05, rates=(1.0,)).decision.effects
    assert decided.level is Level.FAMILY and "backlash" not in decided.finding.rivals
    (decided,) = judged(effects=(*FEW, "servo_lag"), play=0.05, rates=(1.0,)).decision.effects
    assert decided.level is None and "latency" in decided.finding.rivals, "play and what creeps look alike"


def test_an_effect_that_no_file_holds_is_not_named():
    answer = judged(effects=("drift", "backlash"), relaxed=0.2, hold=4.0)
    assert answer.found.gap
    assert answer.decision.status != "named"


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
    assert answer.decision.status == "unknown"
    words = reason_in_words(answer.decision, answer.found, answer.checks)
    assert answer.found.gap or "press 0, press 1" in words


@pytest.mark.parametrize(("gain", "named"), [(0.14, None), (0.18, "named")])
def test_a_channel_is_named_by_what_calibration_leaves_open(gain, named):
    """It was chosen among channels, not among all effects: three standard deviations of the prior are its bar."""
    gains = np.array([gain, -gain, *np.tile([0.12, -0.12], 11)])
    prior, own = {"channel_gain": 0.05}, load("channel_gain")
    setting = SimpleNamespace(nuisance=prior, channel_gain=own, course=SimpleNamespace(force=None))
    problem, halves = SimpleNamespace(setting=setting), np.stack([gains, gains])
    made = gains_beyond_calibration(SimpleNamespace(gains=gains, halves=halves, problem=problem))
    assert [settled(m) for m in made] == ([named] if named else [])
    halves = np.stack([0 * gains, 2 * gains])
    assert not gains_beyond_calibration(SimpleNamespace(gains=gains, halves=halves, problem=problem)), "no constant"
    assert all(m.needed == BEYOND for m in made)


@pytest.mark.parametrize(
    ("necessity", "p", "named"),
    [(2.9, None, False), (3.1, None, True), (2.9, 0.002, True), (2.9, 0.004, False), (4, 0.04, True), (9, 0.06, False)],
)
def test_what_did_not_race_is_named_by_its_necessity_alone(necessity, p, named):
    one = FoundEffect(None, {}, (), (), {}, necessity, corrected_p=p, needed=BEYOND)
    assert (settled(one) == "named") == named


@pytest.mark.parametrize(
    ("share", "rival", "others", "enough"),
    [(0.04, 1.0, 1, True), (0.1, 30.0, 0, True), (0.1, 5.0, 0, False), (0.16, 30.0, 0, False), (0.1, 30.0, 1, False)],
)
def test_a_single_effect_may_leave_more_where_every_rival_leaves_twice_as_much(share, rival, others, enough):
    left = SimpleNamespace(gain=10.0, t=4.0)
    one = FoundEffect(None, {}, (), (), {}, 9.0, losses={"creep": rival})
    assert adequate(SimpleNamespace(left=left, share_left=share), [one] * (1 + others)) == enough


@pytest.mark.parametrize(
    ("margin", "behind", "rival"),
    [(1.0, 0.0, True), (3.0, 0.0, False), (1.0, 40.0, False), (-1.0, 40.0, False), (-4.0, 40.0, True)],
)
def test_a_rival_with_more_numbers_is_out_unless_the_episodes_prefer_it(margin, behind, rival):
    assert stands_in(margin, 2.33, behind) == rival


@pytest.mark.parametrize(("margin", "rival"), [(-0.5, False), (-1.5, True), (-4.0, True)])
def test_one_of_another_family_with_more_numbers_stays_in_sooner(margin, rival):
    assert stands_in(margin, 2.33, 40.0, kin=False) == rival


def test_a_rare_mechanism_is_out_sooner_and_takes_more_to_be_named():
    common, rare = load("relaxation"), load("poroelasticity")
    alike = required_margin(common, load("creep"))
    assert required_margin(common, rare) < alike < required_margin(rare, common)
    assert required_margin(common, rare) >= 1, "the episodes must be on its side, however rare the other is"
    # A standard error squared is two nats of likelihood: what is left of odds is the same.
    assert np.exp(-(required_margin(rare, common) ** 2) / 2) / rare.odds == pytest.approx(np.exp(-(alike**2) / 2))


@pytest.mark.parametrize(
    ("power", "share", "status"),
    [
        (40.0, 0.7, "named"),
        (40.0, 0.3, "unknown"),
        (3.0, 0.3, "ambiguous"),
        (3.0, -0.5, "unknown"),
        (0.5, -0.5, "ambiguous"),
    ],
)
def test_sealed_episodes_take_a_name_away_where_chance_is_no_reason(power, share, status):
    """An answer that they should hardly show is not refuted by them, and not named while their gain may be zero."""
    one = FoundEffect(Placed(load("latency"), {"L": np.array(0.05)}), {}, (), (), {}, 9.0, corrected_p=0.001)
    setting = SimpleNamespace(
        course=course(episodes=8), channel_gain=None, response=FittedResponse(course(episodes=8)), nuisance={}
    )
    fields = {
        "effects": (one,),
        "until": "decide",
        "gap": True,
        "tests": SimpleNamespace(p_generic=0.001),
        "left": SimpleNamespace(t=0.0, gain=0.0),
        "share_left": 0.0,
        "loudness": 2.0,
        "explained": 400.0,
        "values": np.ones(40),
        "gains": np.zeros(3),
        "energy": (np.ones(40),) * 2,
        "problem": SimpleNamespace(setting=setting, null=SimpleNamespace(odd=())),
    }
    found = cast(Any, SimpleNamespace(**fields))
    assert decide(found, DataChecks(44), (), sealed(power, share)).status == status


@pytest.mark.parametrize(
    ("gap", "share", "status"),
    [(True, None, "named"), (False, None, "ambiguous"), (False, 0.9, "named"), (False, 0.1, "unknown")],
)
def test_behind_a_closed_gate_sealed_episodes_alone_bear_a_gain_out(gap, share, status):
    gains = np.array([0.3, -0.3, *np.tile([0.01, -0.01], 11)])
    made = course(episodes=8)
    setting = SimpleNamespace(
        course=made, channel_gain=load("channel_gain"), nuisance={"channel_gain": 0.05}, response=FittedResponse(made)
    )
    fields = {
        "effects": (),
        "until": "decide",
        "gap": gap,
        "tests": SimpleNamespace(p_generic=0.6),
        "explained": 0.0,
        "left": SimpleNamespace(t=0.0, gain=0.0),
        "share_left": 0.0,
        "loudness": 1.0,
        "values": np.ones(40),
        "gains": gains,
        "halves": np.stack([gains, gains]),
        "energy": (np.ones(40),) * 2,
        "problem": SimpleNamespace(setting=setting, null=SimpleNamespace(odd=())),
    }
    shown = None if share is None else sealed(40.0, share)
    assert decide(cast(Any, SimpleNamespace(**fields)), DataChecks(44), (), shown).status == status


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
    assert answer.decision.status == "ambiguous"
    assert not [e for e in answer.decision.effects if e.status == "named"], "one rate leaves each open"
    told = {name for e in answer.decision.effects for name in (e.finding.placed.effect.called, *e.finding.rivals)}
    assert {"latency", "backlash"} <= told
    assert judged(effects=effects, play=0.05, delay=0.1).names == {"latency", "backlash"}, "two rates split them"


def test_a_pairs_second_effect_is_held_to_what_the_firsts_equation_may_be_off_about():
    """A law may be off by 10 %, what a fitted response makes of it by 15: 1 % of the energy says nothing.

    Three times as far where both are of one ambiguity group: 3.4 %.
    """

    def model(loss, *effects):
        placed = [SimpleNamespace(effect=load(name)) for name in effects]
        return SimpleNamespace(loss=loss, placed=placed, response=SimpleNamespace(form_error=0.15))

    nothing, alone = model(1000.0), model(500.0, "relaxation")
    slight, sound = (model(loss, "relaxation", "backlash") for loss in (496.0, 490.0))
    assert without_minor([slight, alone], nothing) is alone
    assert without_minor([sound, alone], nothing) is sound
    assert without_minor([alone], nothing) is alone
    friction = model(500.0, "hysteresis")
    kin, sure = (model(loss, "hysteresis", "backlash") for loss in (485.0, 480.0))
    assert without_minor([kin, friction], nothing) is friction
    assert without_minor([sure, friction], nothing) is sure
