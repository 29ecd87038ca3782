"""Whether a path has a side on which nothing is touched: a damper's piston has none."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.chain.at_rest import always_touched
from tacdata.discrepancy.data.checks import check
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting


def damper(zero):
    """Return strokes of a damper, 2 mm to both sides, whose depth is counted from ``zero`` [mm]."""
    made = course(episodes=12)
    at = made.time - np.repeat(made.time[np.flatnonzero(made.first)], np.bincount(made.episode))
    depth = 2.0 * np.sin(2 * np.pi * at / 3.0)
    friction = 30.0 * np.tanh(np.cos(2 * np.pi * at / 3.0) * 5)
    readings = (50.0 * depth + friction)[:, None] + np.random.default_rng(2).normal(size=(made.rows, 3))
    tip = np.column_stack([made.tip[:, :2], depth - zero])
    return replace(made, tip=tip, readings=np.where(made.averaged[:, None] > 0, readings, np.nan))


def test_a_damper_touches_on_both_sides_of_its_zero():
    assert always_touched(damper(0.0)) == pytest.approx(2.0, abs=0.02)
    assert always_touched(damper(-2.0)) == 0.0, "counted from the lowest"


def test_the_air_is_no_contact():
    """A skin is pressed; from far above; beside a loud channel that nothing presses; and not touched at all."""
    made = course(episodes=12)
    far = replace(made, tip=np.where(made.tip[:, 2:] < 0, made.tip * [1, 1, 20], made.tip))
    loud = np.column_stack([made.readings, 1e3 * np.random.default_rng(4).normal(size=made.rows)])
    centers = None if made.centers is None else np.vstack([made.centers, made.centers[:1]])
    loud = replace(made, readings=np.where(made.averaged[:, None] > 0, loud, np.nan), centers=centers)
    assert always_touched(made) == always_touched(far) == always_touched(loud) == 0.0
    assert always_touched(replace(made, tip=made.tip - [0, 0, 5.0])) == 0.0


def test_nothing_is_named_where_half_of_the_strokes_count_as_air():
    made = damper(0.0)
    setting = Setting(made, FittedResponse(made), [])
    words = check(setting).contradictions
    assert len(words) == 1
    assert "down to 2 mm" in words[0]
    assert "offset: 2 under depth" in words[0]
