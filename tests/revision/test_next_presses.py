"""The presses that come next tell the rivals apart, stay within what was recorded, and can be run."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "discrepancy"))
from pressing import course

from tacdata.chain import predict
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.effects import Placed, load
from tacdata.plans import Plan
from tacdata.revision.comparison import Comparison
from tacdata.revision.next_presses import plan as plan_module
from tacdata.revision.next_presses.machine import MachineLimits
from tacdata.revision.next_presses.plan import choose, left_open, plan_of
from tacdata.revision.next_presses.rivals import Rival
from tacdata.revision.next_presses.trial import elsewhere, laid_out, trials

PLAN = Plan.from_document(
    {
        "version": "1.1",
        "name": "one speed",
        "indenters": {"ball": {"shape": "sphere", "radius": 4.0}},
        "motion": {
            "clearance": 3.0,
            "travel_speed": 3.0,
            "approach_speed": 3.0,
            "press_speed": 1.0,
            "hold": 1.0,
            "rest": 1.0,
        },
        "presses": [{"indenter": "ball", "x": 0.0, "y": 0.0, "depth": 1.0}],
    },
    "test",
)

MACHINE = MachineLimits.of_plan(PLAN)


@pytest.fixture(scope="module")
def held():
    """Presses of one rate from a drive with play, held against a response without memory."""
    return Comparison(course(rates=(1.0,), play=0.05, episodes=12), read_spec(None))


def rival(held, name, **values):
    placed = [Placed(load(name), {k: np.array(v) for k, v in values.items()})]
    return Rival(load(name).called, tuple(placed), refine(held.setting, placed, held.null, steps=0))


def test_lag_and_play_are_told_apart_by_another_rate(held):
    found = [rival(held, "backlash", b=0.05), rival(held, "latency", L=0.05)]
    chosen = choose(held, found, MACHINE, presses=3)
    assert chosen and all(c.trial.speed != 1.0 for c in chosen)
    pair = ("backlash", "latency")
    again = [t for t in trials(held.course, MACHINE) if t.overshoot == 0]
    best = max(c.nats[pair] for c in chosen)
    assert best > 10
    document = plan_of(chosen, held, PLAN, "next", repeats=3)
    plan = Plan.from_document(document, "next")
    assert len(plan.presses) == 3 * len(chosen)
    assert max(p.deepest for p in plan.presses) <= held.course.tip[:, 2].max() + 1e-9, "nowhere deeper than recorded"
    assert max(p.speed for p in plan.presses) <= PLAN.motion.travel_speed
    assert "backlash" in document["purpose"] and again


def test_rivals_that_say_the_same_get_no_press(held):
    same = [rival(held, "backlash", b=0.05), rival(held, "backlash", b=0.05)]
    same[1] = Rival("twin", same[1].placed, same[1].model)
    assert choose(held, same, MACHINE, presses=3) == []


@pytest.mark.parametrize(("nats", "presses"), [(0.6, 2), (0.2, 1)])
def test_a_pair_that_one_press_hardly_splits_gets_its_press_with_the_repeats(held, monkeypatch, nats, presses):
    """Of three rivals, two differ by less than chance in a press, and by more in the plan's three repeats of it."""
    one, other = trials(held.course, MACHINE)[:2]
    pairs = {one: (9.0, 9.0, 0.0), other: (0.0, 0.0, nats)}
    names = (("backlash", "latency"), ("backlash", "creep"), ("latency", "creep"))
    monkeypatch.setattr(plan_module, "trials", lambda course, machine: [one, other])
    monkeypatch.setattr(
        plan_module, "_distances", lambda held, found, trial, machine: dict(zip(names, pairs[trial], strict=True))
    )
    found = [rival(held, "backlash", b=0.05), rival(held, "latency", L=0.05), rival(held, "creep", f=0.01, tau=2.0)]
    assert len(choose(held, found, MACHINE)) == presses


def test_a_delay_is_told_from_a_filter_by_strokes(held):
    """Both shift a steady move by as much; only where the tip starts and stops do they differ."""
    found = [rival(held, "latency", L=0.02), rival(held, "low_pass_filter", tau=0.02)]
    chosen = choose(held, found, MACHINE, presses=2)
    assert chosen and all(c.trial.strokes and c.trial.speed == 2.0 for c in chosen)
    pair = ("latency", "low_pass_filter")
    bare = replace(chosen[0].trial, strokes=0, stroke=0.0)
    assert chosen[0].nats[pair] > 5 * plan_module._distances(held, found, bare, MACHINE)[pair]
    entry = plan_of(chosen, held, PLAN, "next")["presses"][0]
    assert entry["strokes"] == chosen[0].trial.strokes and 0 < entry["stroke"] < entry["depth"]
    assert left_open(chosen) == ""


def test_play_shows_in_strokes(held):
    """The strokes' turns are no noise of the path, which any play would take up."""
    [trial] = [t for t in trials(held.course, MACHINE) if t.strokes and t.speed == 2.0 and t.site == 0][:1]
    own = laid_out(held.course, trial, MACHINE)
    assert own.dither == 0.0
    response = elsewhere(held.before.response, held.course, own, trial)
    moved = predict(own, response, rival(held, "backlash", b=0.05).placed)
    assert np.abs(moved.pose[:, 2] - own.tip[:, 2]).max() == pytest.approx(0.05)


def test_a_pair_that_no_press_settles_is_said_to_be_beyond_the_guide(held, monkeypatch):
    """Of three rivals two differ by too little for any number of plans: presses are chosen for the others alone."""
    one, other = trials(held.course, MACHINE)[:2]
    names = (("backlash", "latency"), ("backlash", "creep"), ("latency", "creep"))
    pairs = {one: (3.0, 0.0, 0.01), other: (0.0, 1.2, 0.15)}
    monkeypatch.setattr(plan_module, "trials", lambda course, machine: [one, other])
    monkeypatch.setattr(
        plan_module, "_distances", lambda held, found, trial, machine: dict(zip(names, pairs[trial], strict=True))
    )
    found = [rival(held, "backlash", b=0.05), rival(held, "latency", L=0.05), rival(held, "creep", f=0.01, tau=2.0)]
    chosen = choose(held, found, MACHINE)
    assert [c.trial for c in chosen] == [one, other]
    told = left_open(chosen)
    assert "record it 3 times to tell backlash from creep" in told
    assert "no press of this guide tells latency from creep" in told
    pairs[one], pairs[other] = (0.01, 0.01, 0.01), (0.01, 0.01, 0.15)
    assert choose(held, found, MACHINE) == []


def test_a_trial_is_laid_out_as_the_guide_would_run_it(held):
    [trial] = [
        t for t in trials(held.course, MACHINE) if t.overshoot and t.speed == 2.0 and t.hold == 2.0 and t.site == 0
    ]
    own = laid_out(held.course, trial, MACHINE)
    assert own.tip[:, 2].max() == pytest.approx(trial.depth + trial.overshoot)
    held_at = np.isclose(own.tip[:, 2], trial.depth) & (own.time > own.time[np.argmax(own.tip[:, 2])])
    assert np.ptp(own.time[held_at]) == pytest.approx(2.0), "it holds after coming back up"
    moving = np.abs(own.speed[1:])
    assert moving.max() == pytest.approx(2.0, rel=1e-6)
