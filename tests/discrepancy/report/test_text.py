"""A verdict reads plainly: its words agree with its own numbers, and each number has its name."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.heading import Heading, sentence
from tacdata.discrepancy.report.conclude import with_alarms
from tacdata.discrepancy.report.conclusion import Certainty, Conclusion, Level, Named, Reason, SetProbability, Status
from tacdata.discrepancy.report.document import rivals
from tacdata.discrepancy.report.next_steps import REVISE, next_steps
from tacdata.discrepancy.report.sealed_gap import Gap
from tacdata.discrepancy.report.sentence import percent, sentence_of
from tacdata.discrepancy.report.text import in_text
from tacdata.effects import Placed, load

OPEN, SURE, LATER = Certainty.AMBIGUOUS, Certainty.NAMED, Certainty.SUSPECTED


def effect(name, alternatives=(), rivals=None, status="named", probability=0.97):
    """Return an entry of ``effects``."""
    own = load(name)
    return {
        "mechanism": own.called,
        "effect": name,
        "stage": own.stage,
        "family": own.family.value,
        "level": "mechanism",
        "status": status,
        "probability": {"family": 0.99, "mechanism": probability, "form": probability},
        "parameters": {"a": {"value": 0.2, "unit": "1", "error": 0.01}},
        "alternatives": list(alternatives),
        "rivals": rivals or {},
    }


def document(status="named", effects=(), limits=None, sealed=None) -> dict[str, Any]:
    """Return what the text reads of a verdict."""
    return {
        "status": status,
        "why": "so it is",
        "effects": list(effects),
        "posterior": {"nothing": 0.002, "remainder": 0.3},
        "gap": {"seen": True, "before": 3.316, "after": 1.612},
        "located": ["everywhere"],
        "next": [],
        "remarks": [],
        "limits": limits or {},
        "untested": [],
        "unjudgeable": {"frame_compliance": "x", "tilt": "y"},
        "sealed": {
            "episodes": 4,
            "before": 18.489,
            "after": 20.374,
            "ceiling": 1.286,
            "closed": -0.11,
            "interval": [-0.58, 0.66],
            "certain": False,
            "after_interval": [15.1, 26.3],
        }
        | (sealed or {}),
    }


def line(text, beginning):
    """Return the one line that begins so."""
    [found] = [words for words in text.splitlines() if words.strip().startswith(beginning)]
    return found


def named(name, *alternatives, certainty=SURE, level=Level.MECHANISM, probability=0.97):
    """Return an effect of a conclusion."""
    own = level if certainty is SURE else None
    return Named(Placed(load(name), {}), 0, probability, 0.98, probability, own, alternatives, certainty)


def concluded(status, *effects, reason=Reason.OPEN, **more):
    """Return a conclusion."""
    return Conclusion(status, reason, effects, cast(Optimum, None), **more)


def said(conclusion, episodes=4):
    return sentence_of(conclusion, course(episodes=episodes))


def shown(after, **shares):
    """Return the gap on four sealed presses."""
    without = {name: np.full(4, value) for name, value in shares.items()}
    return Gap(np.full(4, 30.0), np.full(4, after), np.full(4, 1.0), tuple("abcd"), without)


def test_where_nothing_is_missing_each_number_has_its_name():
    text = in_text(document("none", sealed={"before": 42.429, "after": 42.429, "ceiling": 12.478}))
    assert "before" not in text and "closed" not in text
    assert line(text, "presses that were").endswith("their own pose and gain taken out: 3.32")
    assert line(text, "4 sealed") == "  4 sealed presses, their own pose and gain left in: 42.4"
    assert line(text, "a regression").endswith("would bring the sealed ones to 12.5")
    same = in_text(document("none", sealed={"before": 57.954, "after": 57.954, "ceiling": 57.954}))
    assert line(same, "4 sealed").endswith("pose and gain left in: 58.0") and "a regression" not in same


def test_the_probabilities_of_nothing_and_of_a_remainder_are_stated():
    words = "probability that nothing is missing: 0.2 %; that something is, which no effect explains: 30 %"
    assert line(in_text(document()), "probability") == words


@pytest.mark.parametrize(
    ("share", "words"), [(1.0, "over 99.9 %"), (0.9951, "99.5 %"), (0.5, "50 %"), (0.0, "under 0.1 %"), (0.948, "95 %")]
)
def test_no_probability_is_written_as_certain(share, words):
    assert percent(share) == words


def test_an_effect_that_is_named_is_not_one_that_would_hardly_be_seen():
    """Nor are other forms of it, or what may stand in for it; what is judged is not called unjudgeable either."""
    limits = {"power_creep": None, "relaxation": 9.0, "bouc_wen": 9.0, "drift": 9.0, "tilt": 1.0}
    told = in_text(document(effects=[effect("power_creep", ("hysteresis",))], limits=limits))
    assert "1 that would be seen only at more than three times their usual size" in line(told, "folded away")
    assert "would be seen" not in in_text(document(effects=[effect("softening")], limits={"softening": None}))
    judged = in_text(document(effects=[effect("carriage_compliance")]))
    assert line(judged, "folded away") == "folded away in verdict.html: 1 effects that cannot be judged here"


def test_the_head_has_size_interval_session_and_date():
    entry = effect("power_creep") | {"parameters": {"f": {"value": 0.2, "unit": "1", "error": 0.01}}}
    heading = {"recordings": ["/data/monday"], "folder": "v", "recorded": "2026-11-27 10:00", "unit": "V"}
    stamp = {"made_at": "2026-11-28T10:00:00", "code_version": "1.2"}
    text = in_text(document("named", [entry]) | {"heading": heading, "provenance": stamp})
    assert text.splitlines()[1:3] == [
        "  size of relaxation: relaxed share over the decades 20 % (90 %: 18.4 to 21.6)",
        "  session monday, recorded 2026-11-27 10:00, judged 2026-11-28, tacdata 1.2",
    ]


def test_the_first_sentence_has_thirty_words_and_an_unknown_verdict_two_hundred():
    clauses = [" ".join(["word"] * 12) for _ in range(40)]
    for between in ("; ", ". ", ", ", ": ", " "):
        head, tail = sentence(between.join(clauses))
        assert 0 < len(head.split()) <= 30
        assert len(f"{head} {tail}".split()) == 480
    long = document("unknown") | {"why": "; ".join(clauses[:4]), "next": clauses, "remarks": clauses}
    assert len(in_text(long).split()) <= 200
    assert in_text(long).endswith("more: verdict.html\n")


def test_a_command_is_filled_in_with_the_paths_of_the_verdict():
    heading = Heading(("a b/s", "t"), "out/v", "", "V")
    assert heading.filled(REVISE) == "`tacdata revise out/v 'a b/s' t --out out/v-revised`"


def test_alternatives_have_their_probabilities_and_so_have_the_others():
    entry = effect("low_pass_filter", ("latency",), {"latency": 0.2, "creep": 0.02, "drift": 0.001}, "ambiguous", 0.7)
    text = in_text(document("ambiguous", [entry | {"level": None}]))
    assert line(text, "low-pass filter:") == "  low-pass filter: ambiguous, 70 % probable"
    assert line(text, "may be in its place").endswith("in its place: latency 20 %")
    assert line(text, "in its place less").endswith("less probable: creep 2 %")


def test_rivals_are_those_of_sets_without_the_effect():
    late, slow, both = (
        tuple(Placed(load(n), {}) for n in names) for names in (("latency",), ("creep",), ("latency", "creep"))
    )
    sets = tuple(SetProbability(p, share, 0.0) for p, share in ((late, 0.6), (slow, 0.3), (both, 0.1)))
    one = named("latency", "creep", certainty=OPEN)
    assert rivals(one, concluded(Status.AMBIGUOUS, one, sets=sets)) == {"creep": 0.3}


def test_a_gap_that_becomes_wider_on_sealed_episodes_is_told_of():
    worse = line(in_text(document("unknown", [effect("power_creep")])), "4 sealed")
    assert worse == "  4 sealed presses, their own pose and gain left in: 18.5 before, 20.4 after, worse by 10 %"
    closed = {"after": 2.0, "ceiling": 1.286, "closed": 0.94, "interval": [0.9, 1.0], "certain": True}
    better = line(in_text(document("named", [effect("power_creep")], sealed=closed)), "4 sealed")
    assert "2.00 after, 94 % of the gap closed (90 %: 90 to 100 %)" in better
    wide = {"after": 2.0, "interval": [-0.3, 1.4], "after_interval": [1.1, 3.4]}
    vague = line(in_text(document("named", [effect("power_creep")], sealed=wide)), "4 sealed")
    assert "2.00 after (90 %: 1.10 to 3.40)" in vague, "four presses carry no share"


def test_where_two_effects_close_the_gap_each_has_its_share():
    shares = {"power_creep": 0.6, "bouc_wen": 0.3}
    closed = {"after": 2.0, "closed": 0.9, "interval": [0.8, 1.0], "certain": True, "shares": shares}
    told = line(in_text(document("named", [effect("power_creep")], sealed=closed)), "4 sealed")
    assert "90 % of the gap closed (90 %: 80 to 100 %): relaxation 60 %, hysteresis 30 %" in told


def test_effects_that_cannot_be_told_apart_are_listed_once_and_plainly():
    one = named("low_pass_filter", "latency", "creep", certainty=OPEN, probability=0.6)
    assert said(concluded(Status.AMBIGUOUS, one)) == (
        "these recordings do not show which effect it is: low-pass filter 60 % probable, else latency or creep"
    )
    sure = named("drift")
    words = said(concluded(Status.AMBIGUOUS, sure, named("backlash", "creep", certainty=OPEN, probability=0.5)))
    assert words.startswith("drift is there. Something else is, too: these recordings do not show which effect it is")
    rates = ("low_pass_filter", "viscosity", "backlash", "hysteresis", "creep")
    assert said(concluded(Status.AMBIGUOUS, named("latency", *rates, certainty=OPEN, probability=0.4))).endswith(
        "latency 40 % probable, else one of 5 others (delay and filtering, memory of the skin or friction and play)"
    )


@pytest.mark.parametrize(
    ("status", "reason", "begins"),
    [
        (Status.NAMED, Reason.NAMED, "give it to the model"),
        (Status.NONE, Reason.QUIET, "nothing: below the limits"),
        (Status.UNKNOWN, Reason.TOO_FEW, "the diagnostic plan"),
        (Status.UNKNOWN, Reason.REMAINDER, "the diagnostic plan"),
        (Status.UNKNOWN, Reason.ODD, "look at these presses"),
        (Status.AMBIGUOUS, Reason.OPEN, "the same presses at three rates"),
    ],
)
def test_every_status_has_a_next_step(status, reason, begins):
    effects = {Status.NAMED: [named("latency")], Status.AMBIGUOUS: [named("latency", "backlash", certainty=OPEN)]}
    conclusion = concluded(status, *effects.get(status, []), reason=reason)
    assert next_steps(conclusion, course(rates=(1.0,), episodes=4))[0].startswith(begins)


def test_an_alarm_is_no_reassurance_and_no_name():
    seen = Alarm("channels are late by times of their own", "look at the order of reading")
    quiet = concluded(Status.NONE, reason=Reason.QUIET, nothing=0.9)
    assert said(quiet).startswith("nothing is missing")
    alarmed = with_alarms(quiet, (seen,))
    assert (alarmed.status, alarmed.reason, alarmed.effects) == (Status.UNKNOWN, Reason.ALARM, ())
    assert said(alarmed) == "no effect of the library shows, but channels are late by times of their own"
    assert next_steps(alarmed, course(episodes=4)) == ["look at the order of reading"]
    beside = with_alarms(concluded(Status.UNKNOWN, reason=Reason.REMAINDER), (seen,))
    assert said(beside) == (
        "something is missing that no modelled effect explains: channels are late by times of their own"
    )
    assert next_steps(beside, course(episodes=4))[0] == "look at the order of reading"


def test_presses_unlike_all_others_are_listed():
    words = said(concluded(Status.UNKNOWN, reason=Reason.ODD, odd=(0, 2)))
    assert words.startswith("press 0, press 2: unlike all other presses of their place")


def test_few_presses_and_contradictions_come_first():
    late = named("latency", certainty=LATER)
    assert said(concluded(Status.UNKNOWN, late, reason=Reason.TOO_FEW)) == (
        "4 presses cannot carry a verdict; so far latency fits best"
    )
    wired = concluded(Status.UNKNOWN, late, reason=Reason.CONTRADICTION, checks=DataChecks(9, wiring=("swapped",)))
    assert said(wired) == "swapped"


def test_a_name_has_its_share_of_the_sealed_gap_and_its_probability():
    one = named("power_creep", probability=0.9951)
    assert said(concluded(Status.NAMED, one, reason=Reason.NAMED)) == "relaxation is there; 99.5 % probable"
    conclusion = concluded(Status.NAMED, one, reason=Reason.NAMED, sealed=shown(7.0))
    assert said(conclusion) == "relaxation is there and closes 79 % of the gap on sealed presses; 99.5 % probable"
    both = concluded(Status.NAMED, one, named("drift"), reason=Reason.NAMED, sealed=shown(1.0))
    assert said(both) == (
        "relaxation and drift are there and close all of the gap on sealed presses; 97 % probable each, at least"
    )


def test_names_are_told_from_effects_that_may_be_there_and_from_a_remainder():
    effects = named("power_creep"), named("bouc_wen", certainty=LATER, probability=0.4)
    gap = shown(7.0, power_creep=27.0, bouc_wen=7.0)
    conclusion = concluded(Status.INCOMPLETE, *effects[::-1], sealed=gap, remainder=0.98)
    assert [e.certainty for e in conclusion.surest_first] == [SURE, LATER]
    assert said(conclusion) == (
        "relaxation is there and closes 79 % of the gap on sealed presses; 97 % probable; hysteresis may be there, "
        "too; something without a name is there, too (98 % probable)"
    )


def test_a_family_that_is_named_is_told_from_a_mechanism_that_is():
    """The most probable law of it is no name, and a pure number has no unit."""
    entry = effect("power_creep", probability=0.6) | {"level": "family"}
    entry["parameters"] = {"f": {"value": 0.2, "unit": "1", "error": 0.01}}
    text = in_text(document("named, incomplete", [entry]))
    assert line(text, "relaxation:") == "  relaxation: most probable; memory of the skin is named, 99.0 % probable"
    assert line(text, "f =") == "    f = 0.2 +- 0.01 (relaxed share over the decades)"
    words = said(concluded(Status.INCOMPLETE, named("power_creep", level=Level.FAMILY), remainder=0.7))
    assert words.startswith("memory of the skin (most probably relaxation) is there; 98 % probable")


def test_what_sealed_presses_refute_is_stated_with_their_share():
    ratio = SimpleNamespace(share=0.1, error=0.2)
    gap = cast(Gap, SimpleNamespace(ratio=ratio, document=dict))
    words = said(concluded(Status.UNKNOWN, named("drift", certainty=LATER), reason=Reason.SEALED, sealed=gap))
    assert words == (
        "drift fits the presses that were judged; the sealed ones do not show it (they hold 10 % of it, with a "
        "standard error of 20 %): not the name"
    )


def test_an_unknown_verdict_lists_the_most_probable_effects():
    words = said(concluded(Status.UNKNOWN, named("latency", certainty=LATER, probability=0.41), remainder=0.99))
    assert words == "something is missing that has no name; the most probable effects: latency 41 %"


def test_numbers_that_are_known_only_together_are_said_to_be():
    entry = effect("thermal_growth")
    entry["parameters"] = {
        "dz": {"value": -0.5807, "unit": "mm", "error": 3.3},
        "tau": {"value": 4623.0, "unit": "s", "error": 29000.0},
    }
    text = in_text(document("named", [entry]))
    assert line(text, "dz =") == "    dz = -0.58 mm (final growth)" and "+-" not in text
    assert line(text, "dz and tau").endswith("are not known, each by itself: other pairs fit as well")
    entry["parameters"]["dz"]["error"] = 0.1
    assert line(in_text(document("named", [entry])), "tau is").endswith("tau is not known: other values fit as well")
    entry["parameters"]["dz"]["at_bound"] = True
    assert line(in_text(document("named", [entry])), "at a physical bound").startswith("    at a physical bound: dz")


def test_a_frame_told_by_specimens_is_no_gap_within_one():
    told = effect("frame_compliance", ["stiffening"], status="ambiguous")
    text = in_text(document("ambiguous", [told]) | {"gap": {"seen": False, "before": 1.0, "after": 1.0}})
    assert "within a specimen; only the comparison of specimens shows it" in line(text, "probability")


def test_nothing_is_said_twice():
    """Neither what the sentence above all says already, nor the same of what is left as of the whole."""
    twice = document("none") | {"why": "no effect shows, but channel 8 hums", "remarks": ["channel 8 hums", "no force"]}
    text = in_text(twice | {"located_after": ["everywhere"]})
    assert text.count("channel 8 hums") == 1 and text.count("everywhere") == 1 and "no force" in text


def test_what_sealed_presses_show_is_told_where_their_mean_square_says_little():
    """Their own poses and gains are in the mean square: larger with the right name, it is no reason against it."""
    ratio = {"observed": 20.7, "expected": 28.0, "share": 0.87, "error": 0.16}
    text = in_text(document("named", [effect("power_creep")], sealed={"ratio": ratio}))
    assert "worse" not in line(text, "4 sealed")
    assert line(text, "pose and gain") == (
        "  pose and gain aside, they show 87 +- 16 % of what the effects predict (100 % if these are there, 0 % if not)"
    )
    against = in_text(document("unknown", [effect("power_creep")], sealed={"ratio": ratio | {"observed": -3.0}}))
    assert "worse by 10 %" in line(against, "4 sealed")


def test_a_share_of_the_gap_is_not_negative():
    widened = {"after": 18.6, "closed": -0.07, "interval": [-0.22, 0.09], "certain": True}
    told = line(
        in_text(document("named", [effect("drift")], sealed=widened | {"ratio": {"observed": 1, "error": None}})), "4"
    )
    assert told.endswith("18.6 after, no better (90 %: -22 to 9 % of it closed)")
