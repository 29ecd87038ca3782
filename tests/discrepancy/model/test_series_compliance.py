"""A frame that gives way shows in specimens of other stiffness, and in nothing else that they may do."""

import numpy as np
import pytest

from tacdata.chain.course import Course, Tool
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.series_compliance import series_compliance
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.document import document
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import load

MATERIALS = (0.25, 1.0, 6.5)
"""Load at a depth of 1 mm [N]."""


def loads(depth, stiffness, power, compliance):
    """Return the load f of f = k (d - C f)^n, by bisection."""
    low, high = np.zeros_like(depth), stiffness * depth**power
    for _ in range(50):
        middle = 0.5 * (low + high)
        more = stiffness * np.maximum(depth - compliance * middle, 0) ** power > middle
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return low


def presses(compliance=0.0, powers=(1.5, 1.5, 1.5), materials=MATERIALS, noise=0.003, seed=0):
    """Return presses of a sphere into three materials, each gain off by 1 %, each touch by 0.03 mm."""
    rng, tips, readings, sites, times = np.random.default_rng(seed), [], [], [], []
    for k in range(18):
        kind, deep = k % 3, (1.0, 1.4, 0.7)[k // 3 % 3]
        time = np.arange(0, 2 * (deep + 0.3) / 0.25, 0.05)
        depth = np.interp(time, [0, (deep + 0.3) / 0.25, time[-1]], [-0.3, deep, -0.3])
        there = np.maximum(depth - 0.03 * rng.normal(), 0)
        load_now = loads(there, materials[kind], powers[kind], compliance) * (1 + 0.01 * rng.normal())
        readings.append(load_now + noise * rng.normal(size=len(time)))
        tips.append(np.column_stack([0 * depth, 0 * depth, depth]))
        times.append(time + 30.0 * k)
        sites.append(kind)
    lengths = [len(t) for t in times]
    count = sum(lengths)
    return Course(
        time=np.concatenate(times),
        episode=np.repeat(np.arange(18), lengths),
        tip=np.concatenate(tips),
        tool=np.zeros(count, dtype=np.int64),
        readings=np.concatenate(readings)[:, None],
        averaged=np.ones(count),
        session=np.zeros(18, dtype=np.int64),
        site=np.array(sites),
        tools=(Tool("ball", "sphere", 4.0),),
        names=tuple(f"press {k}" for k in range(18)),
    )


@pytest.mark.parametrize(("compliance", "power"), [(0.035, 1.5), (0.02, 2.0)])
def test_the_compliance_that_bent_all_of_them_is_told(compliance, power):
    shown = series_compliance(presses(compliance, (power,) * 3))
    assert shown is not None
    assert shown.compliance == pytest.approx(compliance, rel=0.05)
    assert shown.power == pytest.approx(power, abs=0.06)
    assert shown.left[1] < 0.5 * shown.left[0]


@pytest.mark.parametrize(
    "made",
    [
        {"seed": 1},
        {"seed": 2, "noise": 0.02},
        {"compliance": 0.035, "materials": (1.0, 1.2, 1.4)},  # bent alike: their own curve
        {"powers": (1.4, 2.0, 1.6)},  # each follows a law of its own
        {"powers": (1.8, 1.5, 1.35)},  # in the order of their stiffness, too
    ],
)
def test_nothing_is_told_where_specimens_do_not_show_it(made):
    assert series_compliance(presses(**made)) is None


def test_the_verdict_is_a_set_of_the_frame_and_a_law_of_each_material():
    def judged(made):
        setting = Setting(made, FittedResponse(made), [load("latency"), load("drift")])
        conclusion = concluded(made, setting)
        return conclusion, document(conclusion, made, ([], []), {})["remarks"]

    bent, remarks = judged(presses(0.035))
    assert any(words.startswith("if the frame gives way by 0.034") for words in remarks), remarks
    assert bent.status == "ambiguous"
    (one,) = bent.effects
    assert (one.placed.effect.called, one.alternatives) == ("frame_compliance", ("stiffening",))
    straight, remarks = judged(presses(seed=1))
    assert straight.status == "none" and not any("frame gives way" in words for words in remarks)
