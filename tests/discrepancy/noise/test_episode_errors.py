"""How far episodes err by themselves is told from recordings, beside a response that was fitted to them."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.nuisances import FITTED_GAIN_PRIOR, pose_errors
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import load

CLOCKED = ("wear_in", "gain_drift", "thermal_growth", "lost_steps", "softening", "permanent_set")


def scaled(made, gains):
    """Readings above idle times an episode's own gain."""
    return replace(made, readings=5000 + (made.readings - 5000) * gains[made.episode, None])


def set_of(made, effects=CLOCKED, knots=None):
    return Setting(made, FittedResponse(made, knots), [load(name) for name in effects])


def told(setting):
    """Return what was told [mm, 1]: depth and gain of an episode."""
    prior, found = pose_errors(setting, setting.given), null_model(setting).errors
    sizes = np.linalg.norm(found, axis=(0, 1)) / np.linalg.norm(prior, axis=(0, 1))
    return sizes * [0.01 * setting.course.stroke, FITTED_GAIN_PRIOR]


@pytest.mark.parametrize("gain", [0.0, 0.02])
def test_an_episodes_own_gain_and_depth_are_told(gain):
    """48 presses: standard deviations are known to a tenth or two."""
    made = course(episodes=48)
    depth, own = told(set_of(scaled(made, 1 + gain * np.random.default_rng(7).normal(size=48))))
    assert depth == pytest.approx(0.002, rel=0.5)
    assert own == pytest.approx(gain, rel=0.35) if gain else own <= 0.0015


def test_own_gains_are_no_effect():
    made = course(episodes=48)
    setting = set_of(scaled(made, 1 + 0.02 * np.random.default_rng(3).normal(size=48)))
    assert concluded(setting.course, setting).status == "none"


def test_strokes_of_a_recording_share_its_set_up():
    """Four recordings of twelve strokes, each with a gain of its own: drift, unless it is said which is which."""
    made = course(episodes=48)
    which = np.arange(48) // 12
    apart = scaled(made, np.array([1.0, 1.02, 1.04, 1.06])[which])
    stated = []
    for recording in (None, which):
        setting = set_of(replace(apart, recording=recording))
        stated.append(concluded(setting.course, setting).status)
    assert stated[0] != "none" and stated[1] == "none"


@pytest.mark.parametrize(("knots", "seen"), [(7, True), (None, False)])
def test_how_a_skin_is_first_touched_is_no_adhesion(knots, seen):
    """A response with a kink, as thin skins have: too few splines leave what looks like a skin that sticks."""
    made = course(episodes=48, noise=0.3)
    depth = np.maximum(made.tip[:, 2:], 0.0)
    noise = 0.3 * np.random.default_rng(5).normal(size=made.readings.shape)
    setting = set_of(replace(made, readings=5000 + 800 * depth * [1.0, 0.5, 0.2] + noise), ("adhesion",), knots)
    conclusion = concluded(setting.course, setting)
    assert (conclusion.mechanisms.get("adhesion", 0.0) > 0.5) == seen
