"""Episodes that are put aside, and what is shown on them."""

import numpy as np
from pressing import course

from tacdata import documents
from tacdata.discrepancy.judged import judged
from tacdata.discrepancy.sealed import ENOUGH, chosen, without_readings
from tacdata.discrepancy.spec import read_spec
from tacdata.effects import library

FEW = ("latency", "low_pass_filter", "backlash")


def test_a_fifth_is_sealed_by_name_and_never_a_whole_place():
    made = course(episodes=24)
    sealed = chosen(made)
    assert len(sealed) == 4
    assert np.array_equal(sealed, chosen(course(episodes=24, seed=5)))  # names decide, not readings
    assert len(np.unique(np.delete(made.site, sealed))) == 2
    assert len(chosen(course(episodes=ENOUGH - 1))) == 0


def test_sealed_readings_are_not_read_but_their_path_stays():
    made = course(episodes=24)
    sealed = chosen(made)
    left = without_readings(made, sealed)
    assert left.rows == made.rows
    assert not np.isin(left.reduced.episode, sealed).any()


def test_the_gap_on_sealed_episodes_closes_with_the_right_name():
    others = tuple(e.called for e in library() if e.name not in FEW)
    done = judged(course(delay=0.05, episodes=24), read_spec(None), without=others)
    documents.check(done.verdict, "verdict", "verdict")
    shown = done.verdict["sealed"]
    assert done.verdict["status"] == "named"
    assert shown["episodes"] == len(done.verdict["data"]["sealed"]) == 4
    assert shown["after"] < 0.5 * shown["before"]
    assert shown["closed"] > 0.9
    assert shown["interval"][0] <= shown["closed"] + 1e-9


def test_the_gate_can_be_had_alone():
    done = judged(course(delay=0.05, episodes=12), read_spec(None), until="gate")
    assert done.found.gap
    assert not done.verdict["effects"]
    assert "stopped after gate: a gap" in done.verdict["why"]
