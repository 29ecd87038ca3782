"""A law is held against all that its family might do: of a stand-in from the same family, the family is sure."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.levels.lack_of_fit import Lack, another_form, lack, lack_of_fit, with_families
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.discrepancy.search.leftovers import Leftovers
from tacdata.discrepancy.search.problem import prepare
from tacdata.discrepancy.verdict.decide import INCOMPLETE, Decided, Decision, Reason, decide
from tacdata.discrepancy.verdict.reasons import reason_in_words
from tacdata.effects import Family, Placed, load


def one_after_another(clock, channel):
    """A front that reaches the channels in turn."""
    return 1 / (1 + np.exp(-(clock - 0.2 - 0.3 * channel) / 0.03))


def all_at_once(clock, channel):
    """A drift of all channels, by no law of the library."""
    return 1 / (1 + np.exp(-(clock - 0.5) / 0.12))


def as_drift(gain):
    """Return an effect that was fitted to presses whose gains grow by 8 %, with what its family still explains."""
    made = course(episodes=32)
    clock = made.time / made.time[-1]
    grown = 1 + 0.08 * np.stack([gain(clock, channel) for channel in range(3)], axis=1)
    made = replace(made, readings=np.round(5000 + grown * (made.readings - 5000)))
    setting = Setting(made, FittedResponse(made), [load("gain_drift")])
    null = null_model(setting)
    first = Placed(load("gain_drift"), {"k": np.array(0.02)})
    bare, model = refine(setting, [], null), refine(setting, [first], null)
    final = prepare(replace(setting, response=model.response), null, model.placed)
    found = FoundEffect(model.placed[0], {}, (), (), {}, 9.0, bought=bare.loss - model.loss)
    return found, lack_of_fit(final)


def test_a_front_over_the_channels_is_no_drift_of_the_gain():
    found, lacking = as_drift(one_after_another)
    assert found.bought > 30 and another_form(found, lacking)
    others = {family: own for family, own in lacking.items() if family is not Family.DRIFT}
    assert not another_form(found, others), "no other family's model speaks of it"


def test_a_drift_of_the_gain_by_another_law_is_one():
    found, lacking = as_drift(all_at_once)
    assert found.bought > 30 and lacking[Family.DRIFT].t > 2, "the law is another one, and that is seen"
    assert not another_form(found, lacking)


@pytest.mark.parametrize("planted", [0.0, 40.0])
def test_the_size_is_what_columns_explain_beyond_noise(planted):
    rng, sizes, seen = np.random.default_rng(5), [], []
    folds = np.arange(40) % 5
    for _ in range(100):
        columns = rng.normal(size=(40, 50, 30))
        flat = columns.reshape(-1, 30)
        signal = flat @ rng.normal(size=30)
        residual = rng.normal(size=2000) + signal * np.sqrt(2 * planted / max(float(signal @ signal), 1e-12))
        every = np.concatenate([residual.reshape(40, 50, 1), columns], axis=2)
        found = lack(np.einsum("emi,emj->eij", every, every), folds)
        sizes.append(found.size)
        seen.append(found.t >= 2)
    assert np.mean(sizes) == pytest.approx(planted, abs=3.0)
    assert np.mean(seen) > 0.9 if planted else np.mean(seen) < 0.1


@pytest.mark.parametrize(
    ("family", "lacking", "other"),
    [
        (Family.SKIN_MEMORY, Lack(30.0, 4.0, 40.0), True),
        (Family.SKIN_MEMORY, Lack(30.0, 1.5, 40.0), True),
        (Family.SKIN_MEMORY, Lack(30.0, 0.9, 40.0), False),
        (Family.SKIN_MEMORY, Lack(6.0, 1.5, 40.0), False),
        (Family.SKIN_MEMORY, Lack(5.0, 4.0, 10.0), False),
    ],
)
def test_a_mechanism_falls_to_its_family_by_what_that_explains_of_its_own(family, lacking, other):
    decision, words = decided(family, lacking)
    said = decision.status, decision.effects[0].level
    assert said == ((INCOMPLETE, Level.FAMILY) if other else ("named", Level.FORM))
    assert ("another law" in words and "40 %" in words) is other, words


@pytest.mark.parametrize(
    ("lacking", "there"),
    [
        (Lack(8.0, 3.0, 8.0), True),
        (Lack(8.0, 1.0, 8.0), False),
        (Lack(3.0, 3.0, 8.0), False),
        (Lack(8.0, 3.0, 2.0), False),
    ],
)
def test_what_another_family_surely_explains_makes_a_verdict_incomplete(lacking, there):
    """The name stands. What explains hardly a hundredth may be its own law's error."""
    decision, words = decided(Family.FRICTION_AND_PLAY, lacking)
    assert (decision.status, decision.effects[0].level) == (INCOMPLETE if there else "named", Level.FORM)
    assert ("something of friction and play shows, too, in loading against unloading" in words) is there, words


@pytest.mark.parametrize("t", [3.0, 1.0])
def test_where_no_name_holds_what_shows_of_another_family_is_told(t):
    """A sensor that rocks has no name, but depths go with the side that is pressed: that is where to look."""
    found = findings()
    effects = (Decided(found.effects[0], "suspected", {}, None),)
    lacking = {Family.KINEMATICS: Lack(90.0, t, 95.0)}
    words = reason_in_words(Decision("unknown", Reason.LEFTOVERS, effects, lacking=lacking), found, DataChecks(8))
    assert words.startswith("something is missing that has no name yet; relaxation fits best")
    said = "; something of kinematics shows, too, in depths and places that go with place, side, order or direction"
    assert words.endswith(said) is (t > 2), words


@pytest.mark.parametrize(
    ("family", "gain", "t", "left"),
    [
        (Family.FRICTION_AND_PLAY, 60.0, 3.0, 60.0),
        (Family.FRICTION_AND_PLAY, 60.0, 1.0, 1.0),
        (Family.FRICTION_AND_PLAY, 10.0, 3.0, 1.0),
        (Family.SKIN_MEMORY, 60.0, 3.0, 1.0),
    ],
)
def test_much_that_another_family_explains_is_left_over(family, gain, t, left):
    """A stand-in fits a part: what its own family explains besides is another form of it, and no such sign."""
    found = findings()
    assert with_families(found, {family: Lack(gain, t, gain)}).left.gain == left
    both = {family: Lack(gain, t, gain), Family.SKIN_MEMORY: Lack(70.0, 3.0, 70.0)}
    assert with_families(found, both).left.gain == 1.0, "what the own family explains better is its own"
    alone = replace(found, effects=(replace(found.effects[0], placed=Placed(load("bulge"), {})),))
    assert with_families(alone, {Family.SKIN_MEMORY: Lack(60.0, 3.0, 60.0)}).left.gain == 60.0


@pytest.mark.parametrize(("size", "level"), [(30.0, Level.FAMILY), (10.0, Level.FORM)])
def test_a_law_beside_one_that_is_open_is_held_against_its_family_too(size, level):
    """A front of damp beside what is relaxation or the chip's own baseline: a gain changes, and not by one drift."""
    found = findings()
    unsure = replace(found.effects[0], rivals=("baseline_tracking",), bought=6000.0)
    drift = replace(found.effects[0], placed=Placed(load("gain_drift"), {}), bought=100.0)
    found = replace(found, effects=(unsure, drift), explained=6100.0)
    decision = decide(found, DataChecks(44), lacking={Family.DRIFT: Lack(20.0, 3.0, size)})
    assert decision.status == "ambiguous"
    assert (decision.effects[1].status, decision.effects[1].level) == ("named", level)
    words = reason_in_words(decision, found, DataChecks(44))
    said = "gain and offset in time (gain drift fits best) is there", "another law of gain and offset"
    assert all((part in words) is (level is Level.FAMILY) for part in said), words


@pytest.mark.parametrize(
    ("family", "own", "level"),
    [
        (Family.FRICTION_AND_PLAY, Lack(100.0, 2.5, 110.0), None),
        (Family.FRICTION_AND_PLAY, Lack(100.0, 1.0, 110.0), 3),
        (Family.FRICTION_AND_PLAY, Lack(10.0, 2.5, 110.0), 3),
        (Family.KINEMATICS, Lack(5.0, 2.5, 15.0), 3),
    ],
)
def test_a_second_name_explains_more_than_a_family_without_a_name(family, own, level):
    """A tool that slides in its holder looks like a screw of the drive, and as much like friction that none names."""
    found = findings()
    first = replace(found.effects[0], placed=Placed(load("crosstalk"), {}), bought=7000.0)
    second = replace(found.effects[0], placed=Placed(load("screw_error"), {}), bought=130.0)
    found = replace(found, effects=(first, second), explained=7130.0)
    decision = decide(found, DataChecks(44), lacking={family: own})
    assert decision.effects[0].level is Level.FORM, "beside the first it is little"
    assert decision.effects[1].level is (Level.FORM if level else None)
    assert decision.status == ("named" if level else INCOMPLETE)


def decided(family, lacking):
    """Return what is decided of a relaxation beside what a family still explains, and its words."""
    found, checks = findings(), DataChecks(44)
    decision = decide(found, checks, lacking={family: lacking})
    return decision, reason_in_words(decision, found, checks)


def findings():
    mine = FoundEffect(Placed(load("relaxation"), {}), {}, (), (), {}, 9.0, corrected_p=0.001, bought=100.0)
    made = course(episodes=8)
    setting = SimpleNamespace(course=made, channel_gain=None, response=FittedResponse(made), nuisance={})
    problem: Any = SimpleNamespace(setting=setting, null=SimpleNamespace(odd=()))
    tests: Any = SimpleNamespace(p_generic=0.001)
    ones, zeros = np.ones(40), np.zeros(3)
    return Findings(
        gap=True,
        tests=tests,
        effects=(mine,),
        left=Leftovers(1.0, 0.0),
        explained=100.0,
        energy=(ones, ones),
        values=ones,
        given=problem,
        problem=problem,
        final=problem,
        limits={},
        gains=zeros,
        halves=np.stack([zeros, zeros]),
    )
