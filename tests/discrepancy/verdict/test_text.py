"""A verdict reads plainly: what it says agrees with its own numbers, and each number says what it is."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.heading import Heading, sentence
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.verdict.decide import Decided, Decision, Reason
from tacdata.discrepancy.verdict.document import REVISE, following
from tacdata.discrepancy.verdict.reasons import reason_in_words
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.discrepancy.verdict.text import in_text
from tacdata.effects import Placed, load


def effect(name, alternatives=(), margins=None, status="named"):
    """Return an entry of ``effects``."""
    own = load(name)
    return {
        "mechanism": own.called,
        "effect": name,
        "stage": own.stage,
        "status": status,
        "confidence": None,
        "parameters": {"a": {"value": 0.2, "unit": "1", "error": 0.01}},
        "alternatives": list(alternatives),
        "margins": margins or {},
    }


def document(status="named", effects=(), limits=None, sealed=None, share=0.02) -> dict[str, Any]:
    """Return what the text reads of a verdict."""
    return {
        "status": status,
        "why": "so it is",
        "effects": list(effects),
        "gate": {"gap": True, "p": 0.001, "p_generic": 1.0},
        "left": {"before": 3.316, "after": 1.612, "share": share, "t": 3.0},
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


def test_where_nothing_is_missing_no_share_of_it_is_left_and_each_number_says_what_it_is():
    text = in_text(document("none", share=1.0, sealed={"before": 42.429, "after": 42.429, "ceiling": 12.478}))
    assert "could be explained" not in text and "before" not in text and "closed" not in text
    assert line(text, "fitted presses") == "  fitted presses, without each press's own pose and gain: 3.32"
    assert line(text, "4 sealed") == "  4 sealed presses, with each press's own pose and gain: 42.4"
    assert line(text, "a regression").endswith("would bring the sealed ones to 12.5")
    assert line(text, "residual").endswith("as a mean square over the noise (1 is noise alone):")
    same = in_text(document("none", sealed={"before": 57.954, "after": 57.954, "ceiling": 57.954}))
    assert line(same, "4 sealed").endswith("own pose and gain: 58.0") and "a regression" not in same


def test_an_effect_that_is_named_is_not_one_that_would_hardly_be_seen():
    """Nor are other forms of it, or what may explain it as well; what is judged is not called unjudgeable either."""
    limits = {"power_creep": None, "relaxation": 9.0, "bouc_wen": 9.0, "drift": 9.0, "tilt": 1.0}
    told = in_text(document(effects=[effect("power_creep", ("hysteresis",))], limits=limits))
    assert "1 that show only beyond three times their usual size" in line(told, "listed in verdict.html")
    assert "that show only" not in in_text(document(effects=[effect("softening")], limits={"softening": None}))
    judged = in_text(document(effects=[effect("carriage_compliance")]))
    assert line(judged, "listed in verdict.html") == "listed in verdict.html: 1 effects that cannot be judged here"


def test_the_head_has_size_interval_session_and_date():
    entry = effect("power_creep") | {"parameters": {"f": {"value": 0.2, "unit": "1", "error": 0.01}}}
    heading = {"recordings": ["/data/monday"], "folder": "v", "recorded": "2026-11-27 10:00", "unit": "V"}
    stamp = {"made_at": "2026-11-28T10:00:00", "code_version": "1.2"}
    text = in_text(document("named", [entry]) | {"heading": heading, "provenance": stamp})
    assert text.splitlines()[1:3] == [
        "  size of relaxation: relaxed share over the decades 20 % (90 %: 18.4 to 21.6)",
        "  session monday, recorded 2026-11-27 10:00, judged 2026-11-28, tacdata 1.2",
    ]


def test_friction_is_a_force_and_a_clearance_is_a_length():
    rubs = {"value": [0.1, -0.4], "unit": "1", "error": 0.02, "whole": {"low": 2.0, "high": 3.0, "unit": "reading"}}
    gap = {"value": 0.105, "unit": "1", "error": 0.002, "whole": {"low": 27.5, "high": 27.5, "unit": "mm"}}
    entry = effect("friction_clearance") | {"parameters": {"F": rubs, "b": gap}}
    heading = {"recordings": ["/data/monday"], "folder": "v", "recorded": "", "unit": "kip"}
    head = in_text(document("named", [entry]) | {"heading": heading}).splitlines()[1]
    assert head == (
        "  size of dry friction: friction -0.8 to -1.2 kip, -40 % (90 %: -43.3 to -36.7) of the range of the readings "
        "on the channel with most, of 2; clearance 2.89 mm (90 %: 2.8 to 2.98)"
    )


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


def test_what_is_worse_is_not_called_better():
    margins = {"power_creep": -2.7, "relaxation": -2.2, "backlash": 3.9}
    text = in_text(document("ambiguous", [effect("bouc_wen", margins=margins, status="suspected")]))
    assert line(text, "fits better").endswith("standard errors over presses, than: backlash 3.9")
    assert line(text, "fits worse").endswith("than: relaxation 2.7"), "of two forms the nearest"


def test_a_gap_that_becomes_wider_on_sealed_episodes_is_told_of():
    worse = line(in_text(document("unknown", [effect("power_creep")])), "4 sealed")
    assert worse == "  4 sealed presses, with each press's own pose and gain: 18.5 before, 20.4 after, worse by 10 %"
    closed = {"after": 2.0, "ceiling": 1.286, "closed": 0.94, "interval": [0.9, 1.0], "certain": True}
    better = line(in_text(document("named", [effect("power_creep")], sealed=closed)), "4 sealed")
    assert "2.00 after, 94 % of the gap closed (90 %: 90 to 100 %)" in better
    wide = {"after": 2.0, "interval": [-0.3, 1.4], "after_interval": [1.1, 3.4]}
    vague = line(in_text(document("named", [effect("power_creep")], sealed=wide)), "4 sealed")
    assert "2.00 after (90 %: 1.10 to 3.40)" in vague, "four presses carry no share"


def finding(name, *rivals):
    """Return an effect of an answer."""
    return FoundEffect(Placed(load(name), {}), {}, (), rivals, {}, 9.0)


def test_many_that_may_stand_in_are_told_by_family_and_listed_below():
    rates = ("low_pass_filter", "viscosity", "backlash", "hysteresis", "creep")
    text = in_text(document("ambiguous", [effect("latency", rates) | {"parameters": {}}]))
    assert line(text, "these presses do not rule out") == (
        "    these presses do not rule out: low-pass filter, viscosity, backlash, hysteresis, creep"
    )


def test_what_may_stand_in_is_not_called_worse_in_the_same_breath():
    """It is behind, but what is left may turn that around; and a size that cannot be is said to be that."""
    entry = effect("low_pass_filter", ("creep",), {"creep": 4.5, "backlash": 9.0, "nonlinear_relaxation": -2.9})
    text = in_text(document("ambiguous", [entry | {"parameters": {}, "unphysical": ["relaxation"]}]))
    assert line(text, "fits better").endswith("than: backlash 9.0") and "fits worse" not in text
    assert line(text, "does as well").endswith("only with an unphysical size: relaxation")


@pytest.mark.parametrize(
    ("status", "reason", "begins"),
    [
        ("named", Reason.NAMED, "add it to the model"),
        ("none", Reason.QUIET, "nothing: below the limits"),
        ("unknown", Reason.TOO_FEW, "the diagnostic plan"),
        ("unknown", Reason.UNEXPLAINED, "the diagnostic plan"),
        ("ambiguous", Reason.RIVALS, "the same presses at three rates"),
    ],
)
def test_every_status_says_what_to_do_next(status, reason, begins):
    answer = [] if status in ("none", "unknown") else [finding("latency", *(["backlash"] * (status == "ambiguous")))]
    decision = Decision(status, reason, tuple(Decided(f, status, {}, None) for f in answer))
    assert following(decision, course(rates=(1.0,), episodes=4))[0].startswith(begins)


def test_where_two_effects_close_the_gap_each_has_its_share():
    shares = {"power_creep": 0.6, "bouc_wen": 0.3}
    closed = {"after": 2.0, "closed": 0.9, "interval": [0.8, 1.0], "certain": True, "shares": shares}
    told = line(in_text(document("named", [effect("power_creep")], sealed=closed)), "4 sealed")
    assert "90 % of the gap closed (90 %: 80 to 100 %): relaxation 60 %, hysteresis 30 %" in told


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


def test_a_gap_that_hardly_closes_is_not_told_in_shares():
    decision = Decision("ambiguous", Reason.RIVALS, (Decided(finding("latency", "creep"), "ambiguous", {}, None),))
    found = cast(Findings, SimpleNamespace(until="decide", share_left=0.0, left=SimpleNamespace(t=0.0)))
    for after, told in ((29.9, False), (7.0, True)):
        shown = Gap(np.full(4, 30.0), np.full(4, after), np.full(4, 1.0), tuple("abcd"))
        assert ("of the gap" in reason_in_words(decision, found, DataChecks(8), shown)) == told


def test_a_family_that_is_named_is_told_from_a_mechanism_that_is():
    """What fits best is no name, and a pure number has no unit."""
    entry = effect("power_creep") | {"family": "memory of the skin", "level": "family"}
    entry["parameters"] = {"f": {"value": 0.2, "unit": "1", "error": 0.01}}
    text = in_text(document("named, incomplete", [entry]))
    assert line(text, "relaxation:") == "  relaxation: fits best; memory of the skin is named"
    assert line(text, "f =") == "    f = 0.2 +- 0.01 (relaxed share over the decades)"
    open_one = in_text(document("ambiguous", [entry | {"status": "ambiguous"}]))
    assert line(open_one, "relaxation:") == "  relaxation: ambiguous; either way it is memory of the skin"
    sure = in_text(document("named", [effect("softening") | {"confidence": 0.931}]))
    assert line(sure, "softening:") == "  softening: named, 93 % sure"


def test_a_rival_that_fits_as_well_is_not_said_to_fit_better():
    """It is out because it needs more numbers."""
    text = in_text(document("named", [effect("permanent_set", margins={"thermal_growth": 0.0, "lost_steps": -1.2})]))
    assert line(text, "fits as well") == "    fits as well, with more numbers: thermal growth"
    assert line(text, "fits worse").endswith("than: lost steps 1.2")


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


def test_whether_there_is_a_gap_comes_before_its_probability():
    assert line(in_text(document()), "is there").startswith("is there a gap? yes, beyond chance: p = 0.001")
    quiet = document("none") | {"gate": {"gap": False, "p": 0.2, "p_generic": 0.5}}
    assert line(in_text(quiet), "is there").startswith("is there a gap? none beyond chance: p = 0.200")


def test_a_frame_told_by_specimens_is_no_gap_within_one():
    told = effect("frame_compliance") | {"status": "ambiguous", "alternatives": ["stiffening"]}
    shown = document("ambiguous", [told]) | {"gate": {"gap": False, "p": 0.7, "p_generic": 1.0}}
    between = "is there a gap? not within a specimen, only between specimens: p = 0.700"
    assert line(in_text(shown), "is there").startswith(between)
    gains = shown | {"effects": [effect("channel_gain")]}
    assert line(in_text(gains), "is there").startswith("is there a gap? none beyond chance: p")


def test_nothing_is_said_twice():
    """Neither what the sentence above all says already, nor the same of what is left as of the whole."""
    twice = document("none") | {"why": "no effect shows, but channel 8 hums", "remarks": ["channel 8 hums", "no force"]}
    text = in_text(twice | {"located_after": ["everywhere"]})
    assert text.count("channel 8 hums") == 1 and text.count("everywhere") == 1 and "no force" in text


def test_a_share_of_the_gap_is_not_negative():
    widened = {"after": 18.6, "closed": -0.07, "interval": [-0.22, 0.09], "certain": True}
    told = line(
        in_text(document("named", [effect("drift")], sealed=widened | {"ratio": {"observed": 1, "error": None}})), "4"
    )
    assert told.endswith("18.6 after, no better (90 %: -22 to 9 % of it closed)")
