"""Intervals are wider outside of the area that was pressed, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.pressed_area import RAMP, WIDEST, PressedArea, deepest, pressed_area

PITCH, SHAPE = 0.4, (35, 26)


def blob(x, y, depth=1.0):
    """Return a map with its deepest pixel at a place from the centre [mm]."""
    i, j = (np.arange(n)[:, None] - (n - 1) / 2 for n in SHAPE)
    return depth * np.exp(-((i * PITCH - x) ** 2 + (j.T * PITCH - y) ** 2) / 2.0)


def test_the_deepest_pixel_is_placed_from_the_centre():
    places = [(0.0, 0.2), (-4.0, 3.0), (6.0, -4.6)]
    np.testing.assert_allclose(deepest(np.array([blob(*at) for at in places]), PITCH), places, atol=1e-9)


def test_the_area_reaches_beyond_the_outermost_presses_by_their_mean_gap():
    labels = [np.array([blob(x, y), blob(x, y, 0.01)]) for x, y in ((-4.0, -2.2), (0.0, 0.2), (4.0, 2.6))]
    area = pressed_area(labels, PITCH)
    assert area.low == pytest.approx((-8.0, -4.6)) and area.high == pytest.approx((8.0, 5.0))
    assert pressed_area(labels[:1], PITCH) is None
    assert pressed_area([0.01 * label for label in labels], PITCH) is None, "none of them touches"


def test_intervals_widen_over_the_ramp_and_no_further():
    area = PressedArea((-2.0, -1.0), (2.0, 1.0))
    maps = np.array([blob(0.0, 0.2), blob(2.0, 0.2), blob(2.4, 0.2), blob(6.0, 0.2), blob(6.0, 0.2, 0.05)])
    half = 1.0 + (WIDEST - 1.0) * 0.4 / RAMP
    np.testing.assert_allclose(area.widening(maps, PITCH), [1.0, 1.0, half, WIDEST, 1.0])


def test_a_far_contact_has_wider_intervals_that_survive_the_file(tmp_path):
    rng = np.random.default_rng(0)
    labels = [np.array([blob(x, y, d) for d in (0.3, 0.6, 0.9)]) for x, y in rng.uniform(-2, 2, (12, 2))]
    maps = [label * (1.0 + rng.normal(0.0, 0.1)) for label in labels]
    area = pressed_area(labels, PITCH)
    known = conformal_intervals.calibrate(maps, labels, PITCH, "c" * 64, area=area)
    near, far = (known.half_width(blob(x, 0.2)[None], PITCH, 0.68).max() for x in (0.0, 6.0))
    assert far == pytest.approx(WIDEST * near, rel=0.15)
    conformal_intervals.write(tmp_path, known)
    again = conformal_intervals.read(tmp_path, "c" * 64)
    assert again.area == area
    plain = replace(known, area=None)
    assert plain.half_width(blob(6.0, 0.2)[None], PITCH, 0.68).max() == pytest.approx(near, rel=0.15)
