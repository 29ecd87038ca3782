"""A long delay is tried from where readings and path show it; what does not come late brings none."""

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.delays import delays
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.effects import Family, library, load


def begun(**hidden):
    made = course(episodes=8, **hidden)
    return delays(Setting(made, FittedResponse(made), [load("latency"), load("latency_either_way"), load("creep")]))


@pytest.mark.parametrize("delay", [0.3, 0.6])
def test_a_long_delay_is_where_the_search_begins(delay):
    one, either = begun(delay=delay)
    assert (one.effect.name, either.effect.name) == ("latency", "latency_either_way")
    assert float(one.values["L"]) == pytest.approx(delay, abs=0.05)
    for way in ("L_in", "L_out"):
        assert float(either.values[way]) == pytest.approx(delay, abs=0.05)


def test_onset_and_recovery_begin_where_each_is():
    _, either = begun(delay=0.2, recovery=0.5)
    assert float(either.values["L_in"]) == pytest.approx(0.2, abs=0.05)
    assert float(either.values["L_out"]) == pytest.approx(0.5, abs=0.05)


def test_a_long_filter_begins_near_enough_to_be_found():
    """Half a second; from its first-order size the search ends at an eighth of one."""
    made = course(lag=0.5, episodes=8)
    setting = Setting(made, FittedResponse(made), [load("low_pass_filter"), load("viscosity"), load("creep")])
    [begins] = delays(setting)
    assert begins.effect.name == "low_pass_filter"
    [found] = refine(setting, [begins], null_model(setting)).placed
    assert float(found.values["tau"]) == pytest.approx(0.5, abs=0.03)


def test_a_skin_that_relaxes_is_not_early():
    assert begun(relaxed=0.4) == [] == begun()


def test_a_late_clock_is_asked_about_unless_the_answer_is_a_delay():
    own = course(delay=0.4, episodes=10)
    asked, answered = (judge(own, read_spec(None), until=step).document for step in ("gate", "fit"))
    assert any("were the clocks one" in words for words in asked["remarks"])
    assert "latency" in {e["mechanism"] for e in answered["effects"]}
    assert not any("were the clocks one" in words for words in answered["remarks"])


def test_readings_that_come_early_are_asked_about_unless_the_answer_is_a_loop():
    """Friction stands in for a skin that relaxes where nothing else is asked."""
    own = course(relaxed=0.75, rates=(0.15,), episodes=10)
    others = tuple(e.called for e in library() if e.family is not Family.FRICTION_AND_PLAY)
    loop = judge(own, read_spec(None), without=others).document
    assert loop["effects"] and not any("earlier than their times" in words for words in loop["remarks"])
    asked, answered = (judge(own, read_spec(None), until=step).document for step in ("gate", "fit"))
    assert any("earlier than their times" in words for words in asked["remarks"])
    assert "relaxation" in {e["mechanism"] for e in answered["effects"]}
    assert not any("earlier than their times" in words for words in answered["remarks"])


@pytest.mark.parametrize(("late", "words"), [(0.6, "0.60 s late"), (-0.6, "0.60 s early, impossible for a sensor")])
def test_a_long_delay_of_either_sign_is_said_as_it_is(late, words):
    assert words in load("latency").remark({"L": np.array(late)})
    assert load("latency").remark({"L": np.array(late / 100)}) == ""
