"""Few episodes that hold most of the residual are named; a gauge that sees the depth alone is judged with."""

from dataclasses import replace

import numpy as np
from pressing import course

from tacdata.discrepancy.data.clocks import shifted
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.verdict.residual_slices import outstanding


def test_episodes_that_stand_out_by_themselves_are_named():
    values = np.full(20, 100.0)
    energy = 50.0 * np.random.default_rng(0).uniform(0.8, 1.2, 20)
    names = [f"press {k}" for k in range(20)]
    assert outstanding(names, energy, values) == []
    energy[[3, 7]] = 5000.0, 900.0
    [words] = outstanding(names, energy, values)
    assert "press 3 100" in words and "press 7 18" in words and "2 of 20" in words
    assert outstanding(names, 30 * energy[::-1] * (np.arange(20) % 2 + 0.01), values) == [], "half of them is no few"


def test_a_gauge_of_the_depth_alone_is_judged_with():
    """Its x and y are never seen: no noise of theirs can be told."""
    own = course(delay=0.05, episodes=12)
    tag = own.tip + np.array([np.nan, np.nan, 0.0]) + 0.002 * np.random.default_rng(1).normal(size=own.tip.shape)
    made = judge(replace(own, tag=tag), read_spec(None), until="fit")
    assert {m.placed.effect.name for m in made.found.effects} & {"latency", "low_pass_filter"}
    assert np.isfinite(made.found.problem.null.noise.scale).all()


def test_clocks_that_were_not_one_are_told_of_with_what_to_do():
    late = course(delay=1.0, episodes=6)
    is_late, [words] = shifted(late)
    assert is_late and "1.0 s later" in words and "mapping" in words
    assert shifted(course(delay=0.05, relaxed=0.3, episodes=6))[1] == ()


def test_one_press_alone_is_answered_in_words():
    made = judge(course(episodes=1), read_spec(None))
    assert made.document["status"] == "unknown" and "1 presses are too few" in made.document["why"]


def test_a_unit_that_was_stated_is_believed():
    """A strip may be stretched by 80 mm. An import says where a unit was not given."""
    own = course(delay=0.05, episodes=12)
    made = judge(replace(own, tip=own.tip * 80), read_spec(None), until="gate")
    assert "stopped after gate: a gap" in made.document["why"]
    assert not any("in mm" in words for words in made.document["remarks"])
