"""How hidden worlds are scored: on verdicts written by hand."""

import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks" / "hidden_worlds"


@pytest.fixture(scope="module", autouse=True)
def _bench():
    sys.path.insert(0, str(FOLDER))


def verdict(status, *members):
    """Return a verdict of (mechanism, status, alternatives) members."""
    return {
        "status": status,
        "effects": [
            {"mechanism": m, "effect": m, "status": s, "alternatives": list(a), "parameters": {}} for m, s, a in members
        ],
    }


def truth(expected, *names):
    return {"expected": expected, "effects": dict.fromkeys(names, 1.0), "parameters": {}}


LATENCY = ("latency", "named", ())
EITHER = ("latency", "ambiguous", ("low_pass_filter",))


@pytest.mark.parametrize(
    ("known", "said", "expected"),
    [
        (truth("none"), verdict("none"), "right none"),
        (truth("none"), verdict("named", LATENCY), "false name"),
        (truth("none"), verdict("unknown"), "false alarm without a name"),
        (truth("name", "latency"), verdict("named", LATENCY), "success"),
        (truth("name", "wear_in"), verdict("named", ("softening", "named", ())), "success"),
        (truth("name", "backlash"), verdict("named", LATENCY), "wrong name"),
        (truth("name", "backlash"), verdict("ambiguous", LATENCY, ("drift", "ambiguous", ("gain",))), "wrong name"),
        (truth("name", "latency"), verdict("named", LATENCY, ("drift", "named", ())), "wrong name"),
        (truth("name", "latency", "drift"), verdict("named", LATENCY), "wrong name"),
        (truth("name", "latency", "drift"), verdict("named", ("drift", "named", ()), LATENCY), "success"),
        (truth("name", "low_pass_filter"), verdict("ambiguous", EITHER), "set with the truth"),
        (truth("name", "backlash"), verdict("ambiguous", EITHER), "set without the truth"),
        (truth("name", "latency"), verdict("none"), "missed"),
        (truth("name", "latency"), None, "crashed"),
        (truth("set", "latency"), verdict("named", LATENCY), "overclaim"),
        (truth("set", "latency"), verdict("ambiguous", EITHER), "set, as it should"),
        (truth("unknown", "stick_slip"), verdict("unknown", LATENCY), "unknown, as it should"),
        (truth("unknown", "stick_slip"), verdict("named", LATENCY), "wrong name"),
    ],
)
def test_a_verdict_beside_the_truth(known, said, expected):
    from scoring.outcome import outcome

    assert outcome(known, said) == expected


def at_family(status, mechanism, family, *alternatives):
    """Return a verdict that names a family; the mechanism is the one of it that fits best."""
    said = verdict("named, incomplete" if status == "named" else status, (mechanism, status, alternatives))
    said["effects"][0] |= {"level": "family", "family": family}
    return said


FILTERS, MEMORY = "delay and filtering", "memory of the skin"


@pytest.mark.parametrize(
    ("known", "said", "expected"),
    [
        (truth("name", "latency"), at_family("named", "low_pass_filter", FILTERS), "right family"),
        (truth("name", "latency"), at_family("named", "relaxation", MEMORY), "wrong family"),
        (truth("name", "latency"), at_family("ambiguous", "servo_lag", FILTERS, "scan_skew"), "right family"),
        (truth("name", "latency"), at_family("ambiguous", "relaxation", MEMORY, "latency"), "wrong family"),
        (truth("name", "latency"), at_family("ambiguous", "latency", FILTERS, "scan_skew"), "set with the truth"),
        (truth("part", "latency"), at_family("named", "low_pass_filter", FILTERS), "right family"),
        (truth("none"), at_family("named", "latency", FILTERS), "false name"),
        (truth("unknown", "ageing_creep"), at_family("named", "relaxation", MEMORY), "unknown, as it should"),
        (truth("unknown", "ageing_creep"), at_family("named", "latency", FILTERS), "wrong family"),
        (truth("unknown", "motor_noise"), at_family("named", "latency", FILTERS), "wrong family"),
        (
            truth("set", "latency") | {"facts": {"rival": "low_pass_filter"}},
            at_family("named", "latency", FILTERS),
            "set, as it should",
        ),
        (
            truth("set", "latency") | {"facts": {"rival": "relaxation"}},
            at_family("named", "latency", FILTERS),
            "overclaim",
        ),
    ],
)
def test_a_family_is_right_where_the_family_is(known, said, expected):
    from scoring.outcome import found, outcome

    assert outcome(known, said) == expected
    if known["expected"] == "name":
        assert found(known, said, "latency") != "named"


def test_everything_hidden_has_families_that_exist():
    from scoring.outcome import FAMILIES, families
    from worlds.physics import KNOWN, OUTSIDE

    from tacdata.effects.effect import Family

    known = {f.value for f in Family}
    assert set(FAMILIES) <= set(OUTSIDE)
    assert all(families(name) <= known for name in KNOWN)
    assert all(families(name) for name, hidden in KNOWN.items() if hidden.called)


def test_intervals_are_exact_at_the_ends():
    from scoring.measures import interval

    assert interval(0, 200) == (0.0, pytest.approx(0.0183, abs=2e-4))
    assert interval(4, 200)[1] == pytest.approx(0.0504, abs=2e-4)
    assert interval(5, 5)[1] == 1.0


def test_gap_and_labels_know_the_truth_from_the_start():
    from scoring.measures import gap, labels
    from worlds import world

    _, known, _ = world.make(4, {"z_offset": 2.0, "latency": 1.0}, episodes=10)
    known = {k: np.asarray(v, float) for k, v in known.items() if k != "parameters"}
    bare = world.make(4, {}, episodes=10)[1]["oracle"]
    said = {name: known[name] for name in ("time", "episode", "pose")} | {"before": bare, "nominal": known["command"]}
    assert gap({**said, "after": known["oracle"]}, known) == pytest.approx(1.0)
    assert gap({**said, "after": bare}, known) == pytest.approx(0.0)
    before, after = labels({**said, "after": bare}, known, True)
    assert before > 0.02 and after < 1e-6
    assert labels({**said, "after": bare}, known, False) == (before, before)
    # Readings that are far apart cut the path's corners, before as after.
    few = {k: v[::40] for k, v in {**said, "pose": known["command"]}.items()}
    before, after = labels(few, known, True)
    assert before == after
    assert abs(before - labels({**said, "pose": known["command"]}, known, True)[1]) > 1e-5


def test_coverage_and_calibration_count_what_was_given():
    from scoring.measures import calibration, parameters

    said = verdict("named", LATENCY)
    said["effects"][0]["parameters"] = {"L": {"value": 0.05, "interval": [0.04, 0.06]}}
    known = {**truth("name", "latency"), "parameters": {"latency": {"L": 0.055}}}
    assert parameters(known, said)[0]["held"] is True
    assert parameters({**known, "parameters": {"latency": {"L": 0.07}}}, said)[0]["held"] is False
    del said["effects"][0]["parameters"]["L"]["interval"]
    assert parameters(known, said)[0]["held"] is None
    error, brier, _ = calibration([(0.95, True)] * 9 + [(0.95, False)])
    assert error == pytest.approx(0.05)
    assert brier == pytest.approx(0.9 * 0.0025 + 0.1 * 0.9025)


def test_what_a_verdict_lacks_is_said_to_be_missing():
    from scoring.tables import document

    row = {
        "id": "a",
        "block": "nulls",
        "name": "x",
        "response": "table",
        "effects": [],
        "times": {},
        "facts": {},
        "expected": "none",
        "settings": {},
        "outcome": "right none",
        "engine": {"hash": "h", "commit": None},
        "seconds": 1.0,
        "status": "none",
        "told": [],
        "parameters": [],
        "confidence": [],
        "found": {},
    }
    text = document([row], "workflow")
    assert "| expected calibration error | at most 0.05 | not given | not measured |" in text
    assert "0.0 % (0/1, 0.0 to 97.5)" in text
