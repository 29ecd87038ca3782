"""Readings of a foam that stay high on the way back while its force falls: one friction, each in its own way."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.chain import Course, Tool, predict
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.response_splines import taken_up
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import Placed, load

FEW = (
    "hysteresis_apart",
    "hysteresis",
    "hysteresis_read",
    "dry_friction",
    "backlash",
    "creep",
    "relaxation",
    "latency",
)
RATE = 20


def switched(depth, width, cells=60):
    """Preisach: what relays that switch on and off at depths apart by about a width make of depths up to 1 mm."""
    up, down = np.meshgrid(*[np.linspace(0, 1, cells)] * 2, indexing="ij")
    up, down = up[up >= down], down[up >= down]
    weight, on, made = np.exp(-(((up - down) / width) ** 2)), np.zeros(len(up), bool), []
    for value in depth:
        on = (on | (value >= up)) & (value > down)
        made.append(weight[on].sum() / weight.sum())
    return np.array(made)


def foam(share=0.2, seed=0, episodes=12):
    """Return strokes with holds in which readings follow a density that lags, and the force lacks a part of it."""
    rng, parts, clock = np.random.default_rng(seed), [], 0.0
    for k in range(episodes):
        top, speed = (0.9, 0.6, 0.3)[k % 3], (0.2, 0.6)[k // 3 % 2]
        at = np.cumsum([0, 1.0, top / speed, 1.0, 0.5 * top / speed, 1.0, 0.5 * top / speed, 1.0])
        time = np.arange(0, at[-1], 1 / RATE)
        depth = np.interp(time, at, top * np.array([0, 0, 1, 1, 0.5, 0.5, 0, 0]))
        lag = switched(depth, 0.2)
        dense = (1 - share) * depth + share * lag
        read = 20 + 10 * dense / (1 - 0.6 * dense) + 0.004 * rng.normal(size=len(time))
        squeezed = np.maximum(depth - 0.3 * (dense - (1 - share) * depth), 0.0)
        parts.append((clock + time, depth, read, 30 * squeezed**1.4 + 0.02 * rng.normal(size=len(time))))
        clock += at[-1] + rng.uniform(2, 6)
    time, depth, read, force = (np.concatenate(column) for column in zip(*parts, strict=True))
    episode = np.repeat(np.arange(episodes), [len(part[0]) for part in parts])
    return Course(
        time=time,
        episode=episode,
        tip=np.column_stack([0 * depth, 0 * depth, depth]),
        tool=np.zeros(len(time), dtype=int),
        readings=read[:, None],
        averaged=np.ones(len(time)),
        session=np.zeros(episodes, dtype=int),
        site=np.zeros(episodes, dtype=int),
        tools=(Tool("flat", "unknown", float("nan")),),
        names=tuple(f"stroke {k}" for k in range(episodes)),
        force=force,
    )


def named(made):
    setting = Setting(made, FittedResponse(made), [load(name) for name in FEW])
    return {e.placed.effect.called: e.placed for e in concluded(made, setting).named}


def test_a_foams_friction_is_named_and_readings_stay_high():
    made = named(foam())
    assert set(made) == {"hysteresis"}
    values = made["hysteresis"].values
    assert float(values["a"]) > 0 and float(values["b"]) > 0


def test_a_foam_without_friction_has_none():
    assert not named(foam(share=0.0))


@pytest.mark.parametrize("stream", ["readings", "force"])
def test_splines_of_the_force_go_through_what_the_force_does(stream):
    made = foam(episodes=6)
    response, effect = FittedResponse(made), load("hysteresis_apart")
    model = [Placed(effect, {"a": np.array(0.3), "b": np.array(0.5), "w": np.array(0.1)})]
    by, channel = np.linspace(1.0, 2.0, response.width), int(stream == "force")
    other = response.copied()
    other._weights = [w + 1e-3 * by[: len(w), None] * (np.arange(2) == channel) for w in response._weights]
    other._answers = []
    said = [predict(made, r, model) for r in (response, other)]
    change = said[1].force - said[0].force if channel else (said[1].signal - said[0].signal)[:, 0]
    adds = 1e-3 * (taken_up(made, response, model)[:, channel] - response.air) @ by
    assert change == pytest.approx(adds, abs=1e-6)


def test_without_a_force_the_two_ways_are_one():
    made = foam(episodes=6)
    assert "force" in load("hysteresis_apart").unjudgeable(replace(made, force=None), FittedResponse(made))
