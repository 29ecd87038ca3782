"""The noise of a tag, or a gauge, is told beside what goes with depth: a frame that gives way is no noise of it."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.noise.readings import beside_depth
from tacdata.discrepancy.report.judgement import concluded
from tacdata.effects import load

SCALES = ("travel_scale", "view_scale")
NOISE = 0.002
"""Of the gauge [mm]."""


def gauged(compliance, power=1.0, seed=0):
    """Return presses with a gauge at the tip: the frame gives way by a share of the depth's power 1.5 [mm]."""
    made = course(seed=seed, power=power)
    rng, depth = np.random.default_rng(seed), np.maximum(made.tip[:, 2], 0.0)
    seen = np.full((made.rows, 3), np.nan)
    given = compliance * (depth / depth.max()) ** 1.5
    seen[:, 2] = made.tip[:, 2] + NOISE * rng.normal(size=made.rows)
    # The skin is pressed less than was asked for by as much.
    asked = made.tip.copy()
    asked[:, 2] += given
    return replace(made, tip=asked, tag=seen)


def decided(made, effects):
    """Return what may be said of presses."""
    return concluded(made, Setting(made, FittedResponse(made), [load(name) for name in effects]))


@pytest.mark.parametrize("compliance", [0.0, 0.1])
def test_a_gauges_noise_is_its_own(compliance):
    made = gauged(compliance)
    told = null_model(Setting(made, FittedResponse(made), [])).noise
    assert told.scale[-1] == pytest.approx(NOISE, rel=0.3)


def test_nothing_is_taken_from_readings_or_from_recordings_without_a_tag():
    made = gauged(0.1)
    residual = np.random.default_rng(0).normal(size=(made.rows, 6))
    np.testing.assert_array_equal(beside_depth(residual, made)[:, :3], residual[:, :3])
    np.testing.assert_array_equal(beside_depth(residual[:, :3], replace(made, tag=None)), residual[:, :3])


READ_BY_A_POWER = pytest.mark.long("tacdata/discrepancy", reason="the same verdict on readings of another power")


@pytest.mark.parametrize("power", [1.0, pytest.param(0.7, marks=READ_BY_A_POWER)])
def test_compliance_that_a_gauge_sees_is_named_whatever_power_of_load_is_read(power):
    made = gauged(0.05, power)
    effects = ("carriage_compliance", "carriage_compliance_read", "travel_scale", "screw_error", "backlash", "latency")
    answer = decided(made, effects)
    assert answer.status == "named"
    (effect,) = answer.effects
    assert effect.placed.effect.called == "frame_compliance"
    assert float(effect.placed.values["c"]) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("scale", [0.004, 0.06])
def test_a_gauges_scale_is_known_so_well_and_no_better(scale):
    """What calibrating a gauge leaves is no error of the drive; what is far more is one of the two's."""
    made = gauged(0.0)
    seen = made.tag.copy()
    seen[:, 2] += scale * made.tip[:, 2]
    answer = decided(replace(made, tag=seen), (*SCALES, "screw_error"))
    if scale < 0.005:
        assert answer.status == "none"
        return
    assert answer.status == "ambiguous"
    (effect,) = answer.effects
    assert {effect.placed.effect.called, *effect.alternatives} == {"view_scale", "travel_scale"}
    (value,) = effect.placed.values.values()
    assert float(value) == pytest.approx(scale, rel=0.05)


@pytest.mark.long("tacdata/discrepancy", reason="a verdict among scales that are nearly alike")
def test_compliance_is_named_beside_a_gauge_of_slightly_wrong_scale():
    made = gauged(0.05)
    seen = made.tag.copy()
    seen[:, 2] *= 1.004
    effects = ("carriage_compliance", "carriage_compliance_read", *SCALES, "screw_error", "latency")
    answer = decided(replace(made, tag=seen), effects)
    assert answer.status == "named"
    assert [e.placed.effect.called for e in answer.effects] == ["frame_compliance"]
