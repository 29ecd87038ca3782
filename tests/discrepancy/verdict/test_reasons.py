"""The sentence of a verdict names its answer and its reason."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
from pressing import course

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.verdict.decide import INCOMPLETE, Decided, Decision, Reason, decide
from tacdata.discrepancy.verdict.document import following
from tacdata.discrepancy.verdict.likelihood_ratio import LikelihoodRatio
from tacdata.discrepancy.verdict.reasons import reason_in_words
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.effects import Placed, load


def finding(name, *rivals):
    """Return an effect of an answer."""
    return FoundEffect(Placed(load(name), {}), {}, (), rivals, {}, 9.0)


def said(status, answer, before=None, after=None):
    """Return the sentence of a verdict."""
    found = SimpleNamespace(until="decide", share_left=0.1, left=SimpleNamespace(t=3.0))
    shown = Gap(np.array([before]), np.array([after]), np.array([1.0]), ("press",)) if before else None
    reason = Reason.RIVALS if status == "ambiguous" else Reason.LEFTOVERS
    decision = Decision(status, reason, tuple(Decided(f, status, {}, None) for f in answer))
    return reason_in_words(decision, cast(Findings, found), DataChecks(8), shown)


def test_effects_that_cannot_be_told_apart_are_listed_once_and_plainly():
    rates = ("relaxation", "backlash", "hysteresis", "latency", "creep")
    answer = [finding(n, *(r for r in rates if r != load(n).called)) for n in ("power_creep", "backlash", "bouc_wen")]
    assert said("ambiguous", answer) == (
        "these recordings do not show which effect it is: relaxation, backlash and hysteresis together fit best, but "
        "latency or creep may explain any of them as well"
    )
    assert said("ambiguous", [finding("low_pass_filter", "latency", "creep")]).endswith(
        "low-pass filter fits best, but latency or creep may explain it as well"
    )
    assert said("ambiguous", [finding("drift"), finding("backlash", "creep")]).startswith(
        "drift is there. Another effect is, too. These recordings do not show which: backlash fits best"
    )
    pair = [finding("backlash", "hysteresis"), finding("bouc_wen", "backlash")]
    assert said("ambiguous", pair).endswith("and hysteresis together fit best, but each may explain the others' part")


def quiet():
    """Return findings without an effect, behind a closed gate."""
    tests, null = SimpleNamespace(p_generic=0.5, p=np.ones(1)), SimpleNamespace(odd=())
    setting = SimpleNamespace(course=course(episodes=4), channel_gain=None, response=SimpleNamespace(fitted=False))
    made = SimpleNamespace(
        until="decide",
        effects=(),
        gap=False,
        tests=tests,
        left=SimpleNamespace(t=0.0, gain=0.0),
        share_left=0.0,
        loudness=1.0,
        problem=SimpleNamespace(null=null, setting=setting),
        gains=np.zeros(3),
        halves=np.zeros((2, 3)),
    )
    return cast(Findings, made)


def test_an_alarm_is_no_reassurance_and_no_name():
    """Without one the same findings are `none`."""
    seen = Alarm("channels are late by times of their own", "look at the order of reading")
    assert decide(quiet(), DataChecks(20)).status == "none"
    decision = decide(quiet(), DataChecks(20), raised=(seen,))
    assert (decision.status, decision.reason, decision.effects) == ("unknown", Reason.ALARM, ())
    words = reason_in_words(decision, quiet(), DataChecks(20))
    assert words == "no effect of the library shows, but channels are late by times of their own"
    assert following(decision, course(episodes=4)) == ["look at the order of reading"]
    beside = replace(decision, reason=Reason.UNEXPLAINED)
    words = reason_in_words(beside, quiet(), DataChecks(20))
    assert words == "something is missing that no modelled effect explains: channels are late by times of their own"
    assert following(beside, course(episodes=4))[0] == "look at the order of reading"


def test_what_comes_closest_says_so_if_sealed_episodes_fit_worse():
    assert said("unknown", [finding("power_creep")], 18.489, 20.374) == (
        "something is missing that has no name yet; relaxation fits best and leaves 10 % of the "
        "explainable part, but sealed presses fit worse by 10 % with it (mean square over the noise 18.5 without, 20.4 "
        "with): it is not the name"
    )
    assert "fit no better" in said("unknown", [finding("power_creep")], 20.128, 20.130)
    both = said("unknown", [finding("latency"), finding("power_creep")], 95.0, 6.0)
    assert both == (
        "something is missing that has no name yet; latency and relaxation together fit best and leave 10 % of "
        "the explainable part, so they are not the names, or not all of it"
    )
    assert said("unknown", [finding("thermal_growth", "lost_steps")]).endswith(
        "thermal growth fits best and leaves 10 % of the explainable part, and lost steps may explain it as well"
    )


def test_a_family_that_all_rivals_share_is_said():
    decided = Decided(finding("low_pass_filter", "latency"), "ambiguous", {}, None, Level.FAMILY)
    decision = Decision("ambiguous", Reason.RIVALS, (decided,))
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.1, left=SimpleNamespace(t=3.0)))
    assert reason_in_words(decision, found, DataChecks(8)).endswith(". Either way it is delay and filtering")


def test_an_equation_that_ends_too_early_is_no_unphysical_size():
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.0, left=SimpleNamespace(t=0.0)))
    words = []
    for bound in ("w", "a"):
        one = replace(finding("bouc_wen"), at_bound=(bound,))
        decision = Decision("ambiguous", Reason.RIVALS, (Decided(one, "ambiguous", {}, None, Level.FAMILY),))
        words.append(reason_in_words(decision, found, DataChecks(8)))
    assert "the form is another one" in words[0]
    assert "unphysical" not in words[0]
    assert "unphysical size" in words[1]


def test_what_stays_named_is_told_from_what_stands_in():
    decided = [Decided(finding("power_creep"), "named", {}, None, Level.FORM)]
    decided.append(Decided(finding("bouc_wen"), "suspected", {}, None, None))
    decision = Decision(INCOMPLETE, Reason.INCOMPLETE, tuple(decided))
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.012, left=SimpleNamespace(t=3.0)))
    shown = Gap(np.full(4, 30.0), np.full(4, 7.0), np.full(4, 1.0), tuple("abcd"))
    swapped = replace(decision, effects=tuple(decided[::-1]))
    assert [e.status for e in swapped.surest_first] == ["named", "suspected"]
    assert reason_in_words(decision, found, DataChecks(8), shown) == (
        "relaxation is there and closes 79 % of the gap on sealed presses; hysteresis may be there, too; "
        "1 % of the explainable part has no name yet"
    )


def test_an_effect_that_sealed_presses_do_not_need_is_said_to_be_small():
    decision = Decision("named", Reason.NAMED, (Decided(finding("drift"), "named", {}, None, Level.FORM),))
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.0, left=SimpleNamespace(t=0.0)))
    for after, small in ((29.9, True), (29.0, False)):
        shown = Gap(np.full(4, 30.0), np.full(4, after), np.full(4, 1.0), tuple("abcd"))
        words = reason_in_words(decision, found, DataChecks(8), shown)
        assert words.endswith("It is small: sealed presses fit as well without") == small
        # Given pose and gain of each press, the likelihood may support an effect that hardly lowers the mean square.
        shown = replace(shown, ratio=LikelihoodRatio(77.0, 1.1, 1.0, 77.0))
        words = reason_in_words(decision, found, DataChecks(8), shown)
        assert words.endswith("It is small, yet seen on sealed presses") == small


def test_a_family_is_said_once_with_all_that_fit_best():
    decided = tuple(Decided(finding(n), "named", {}, None, Level.FAMILY) for n in ("drift", "gain_drift"))
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.0, left=SimpleNamespace(t=0.0)))
    words = reason_in_words(Decision(INCOMPLETE, Reason.INCOMPLETE, decided), found, DataChecks(8))
    assert words == f"{load('drift').family.value} (drift and gain drift fit best) is there"


def test_what_is_there_is_told_from_what_more_presses_must_show():
    """Without a rival nothing stands in for either; one is only too weak."""
    weak = Decided(replace(finding("gain_drift"), necessity=1.0), "ambiguous", {}, None)
    sure = Decided(finding("frame_compliance"), "named", {}, None, Level.FORM)
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.0, left=SimpleNamespace(t=0.0)))
    words = reason_in_words(Decision("ambiguous", Reason.RIVALS, (sure, weak)), found, DataChecks(8))
    assert words == (
        "frame compliance is there; gain drift may be there, too; more presses must say whether gain drift is needed"
    )


def test_an_effect_without_a_rival_is_open_for_a_reason():
    ratio = LikelihoodRatio(power=4.0, share=0.6)
    shown = Gap(np.array([2.0]), np.array([2.1]), np.array([1.0]), ("press",), {}, ratio)
    decision = Decision("ambiguous", Reason.RIVALS, (Decided(finding("softening"), "ambiguous", {}, None),))
    words = reason_in_words(decision, quiet(), DataChecks(20), shown)
    assert words.startswith("softening fits best; the sealed presses do not bear it out (they show ")


def test_many_that_may_stand_in_are_told_by_family():
    rates = ("low_pass_filter", "viscosity", "backlash", "hysteresis", "creep")
    assert said("ambiguous", [finding("latency", *rates)]).endswith(
        "latency fits best, but 5 others (delay and filtering, memory of the skin or friction and play) may explain "
        "it as well"
    )
