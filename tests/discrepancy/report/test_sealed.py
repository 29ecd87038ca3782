"""Episodes that are put aside, and what is shown on them."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata import documents
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.report.picture import draw
from tacdata.discrepancy.report.sealed_gap import FEWEST_TO_SEAL, chosen, without_readings
from tacdata.discrepancy.report.text import in_text
from tacdata.effects import library

FEW = ("latency", "low_pass_filter", "backlash")


def test_a_tenth_is_sealed_by_name_and_never_a_whole_place():
    """A handful at least: what is sealed says nothing of which effect it is, and costs power."""
    assert len(chosen(course(episodes=50))) == 5
    made = course(episodes=24)
    sealed = chosen(made)
    assert len(sealed) == 4
    assert np.array_equal(sealed, chosen(course(episodes=24, seed=5)))  # names decide, not readings
    assert len(np.unique(np.delete(made.site, sealed))) == 2
    assert len(chosen(course(episodes=FEWEST_TO_SEAL - 1))) == 0


def test_an_episode_deeper_than_those_that_stay_open_is_not_sealed():
    """A fitted response would be continued to depths that it never saw."""
    made = course(episodes=24)
    for k in chosen(made):
        tip = made.tip.copy()
        tip[made.episode == k, 2] += 0.6
        assert k not in chosen(replace(made, tip=tip))


def test_sealed_readings_are_not_read_but_their_path_stays():
    made = course(episodes=24)
    sealed = chosen(made)
    left = without_readings(made, sealed)
    assert left.rows == made.rows
    assert not np.isin(left.reduced.episode, sealed).any()


def test_the_gap_on_sealed_episodes_closes_with_the_right_name():
    others = tuple(e.called for e in library() if e.called not in FEW)
    done = judge(course(delay=0.05, episodes=24), read_spec(None), without=others)
    documents.check(done.document, "verdict", "verdict")
    shown = done.document["sealed"]
    assert done.document["status"] == "named"
    assert shown["episodes"] == len(done.document["data"]["sealed"]) == 4
    assert shown["after"] < 0.5 * shown["before"]
    assert shown["closed"] > 0.9
    assert shown["interval"][0] <= shown["closed"] + 1e-9


@pytest.mark.parametrize("step", ["gate", "locate"])
def test_the_gate_can_be_had_alone_and_then_where_the_residual_lives(step, tmp_path):
    """Neither step fits an effect; the gate does not look where the residual lives."""
    done = judge(course(delay=0.05, episodes=12), read_spec(None), until=step)
    documents.check(done.document, "verdict", "verdict")
    assert done.document["gap"]["seen"] and not done.document["effects"]
    assert f"stopped after {step}: a gap" in done.document["why"]
    located = step == "locate"
    assert bool(done.document["located"]) == bool(done.document["slices"]) == located
    assert ("where the residual is largest" in in_text(done.document)) == located
    draw(done.conclusion, done.before, done.after, done.document, tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000


def test_a_fitted_response_says_nothing_new_of_the_air():
    """A first episode may begin at the machine's home, far above all others."""
    made = course(episodes=12)
    response = FittedResponse(made)
    here, far = made.tip.copy(), made.tip.copy()
    here[:, 2], far[:, 2] = made.tip[made.read, 2].min(), -25.0
    assert np.array_equal(response.load(far, made.tool), response.load(here, made.tool))
    deeper = here.copy()
    deeper[:, 2] = 1.02 * made.span
    assert (response.load(deeper, made.tool) > response.load(made.tip, made.tool).max(axis=0) * 0.2).any()
