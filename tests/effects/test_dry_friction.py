"""Dry friction: as wide a loop at every depth and rate, told from friction inside the skin and from memory of it."""

import numpy as np
import pytest

from tacdata.chain import Course, Tool
from tacdata.chain.rows import rows_of
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import load

STEP = 0.005


def strokes(seal=0.0, skin=0.0, relaxed=0.0, seed=0):
    """Return strokes of a piston on its spring, three ways at three speeds, time-stepped apart from the library.

    The seal's friction is a force; the skin's a share of load; the relaxed share has a time constant of a second.
    """
    rng, parts, clock = np.random.default_rng(seed), [], 0.0
    for k in range(18):
        way, speed = (6.0, 10.0, 14.0)[k % 3], (2.0, 8.0, 25.0)[k // 3 % 3]
        at = np.cumsum([0, 0.5, (way - 0.5) / speed, 0.5, (way - 0.5) / speed, 0.5])
        path = np.array([0.5, 0.5, way, way, 0.5, 0.5])
        time = np.arange(0, at[-1], STEP)
        depth, stretch, rubbed, late, slow = np.interp(time, at, path), -1.0, -1.0, 0.0, []
        force = (depth / 14) ** 1.1
        out = []
        for step, load_now in zip(np.diff(depth, prepend=depth[0]), force, strict=True):
            stretch = float(np.clip(stretch + step / 0.05, -1, 1))
            rubbed = float(np.clip(rubbed + step / 1.5, -1, 1))
            late += STEP * (load_now - late)
            slow.append(late)
            out.append(seal * stretch + skin * load_now * (rubbed - 1) / 2 - relaxed * late)
        pick = np.arange(int(rng.integers(4)), len(time), 4)
        values = np.round(1000 * (force + np.array(out))[pick] + 2 * rng.normal(size=len(pick)))
        rows = rows_of(time[pick], values[:, None], at, np.column_stack([0 * at, 0 * at, path]))
        parts.append((clock, rows))
        clock += at[-1] + rng.uniform(4, 12)
    count = [len(rows.time) for _, rows in parts]
    episode = np.repeat(np.arange(18), count)
    return Course(
        time=np.concatenate([begin + rows.time for begin, rows in parts]),
        episode=episode,
        tip=np.concatenate([rows.tip for _, rows in parts]),
        tool=np.zeros(len(episode), dtype=int),
        readings=np.concatenate([rows.values for _, rows in parts]),
        averaged=np.concatenate([rows.averaged for _, rows in parts]),
        session=np.zeros(18, dtype=int),
        site=np.zeros(18, dtype=int),
        tools=(Tool("flat", "unknown", float("nan")),),
        names=tuple(f"stroke {k}" for k in range(18)),
    )


FRICTION = ("dry_friction", "bouc_wen", "proportional_hysteresis", "hysteresis", "backlash")


def judged(made, few=(*FRICTION, "relaxation", "viscosity", "latency")):
    """Return which mechanisms are named, and the answer with its numbers."""
    setting = Setting(made, FittedResponse(made), [load(name) for name in few])
    conclusion = concluded(made, setting)
    named = {e.placed.effect.called for e in conclusion.named}
    return named, {e.placed.effect.name: e.placed.values for e in conclusion.effects}


def test_the_friction_of_a_seal_is_named_and_its_width_measured():
    named, values = judged(strokes(seal=0.05))
    assert named == {"dry_friction"}
    assert float(values["dry_friction"]["a"]) == pytest.approx(0.1, rel=0.15)


def test_friction_inside_the_skin_is_not_that_of_a_seal():
    named, _ = judged(strokes(skin=0.12))
    assert named == {"hysteresis"}


def test_loops_that_change_with_the_rate_are_no_friction():
    named, _ = judged(strokes(relaxed=0.2))
    assert not named & {"dry_friction", "hysteresis", "backlash"}


def test_loops_that_change_with_the_rate_are_unknown_where_only_friction_is_tried():
    named, values = judged(strokes(relaxed=0.3), FRICTION)
    assert values, "friction comes closest"
    assert not named


def test_friction_inside_the_skin_whose_equation_ends_before_the_loops_do_is_not_named():
    """Loops of a seal open at once: the shortest way that the other's equation knows is too long."""
    made = strokes(seal=0.05)
    setting = Setting(made, FittedResponse(made), [load("bouc_wen")])
    conclusion = concluded(made, setting)
    (one,) = conclusion.effects
    assert one.estimates["w"].at_bound
    assert not conclusion.named
