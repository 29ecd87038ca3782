"""Depth and position against the prescribed contact."""

import numpy as np
import pytest

from tacdata.sensor import DepthMap
from tacdata.training.metrics.physical import bilinear, score_press

GRID = DepthMap(pixels_x=35, pixels_y=26, pixel_pitch=0.4, depth_max=3.0)


def disc(cx, cy, radius, depth=1.0):
    x, y = np.meshgrid(GRID.x, GRID.y, indexing="ij")
    return np.where((x - cx) ** 2 + (y - cy) ** 2 <= radius**2, depth, 0.0)


def test_bilinear_is_exact_on_a_bilinear_field_and_at_the_corners():
    x, y = np.meshgrid(GRID.x, GRID.y, indexing="ij")
    field = 0.3 + 0.1 * x - 0.2 * y + 0.05 * x * y
    for px, py in [(0.0, 0.0), (1.234, -2.345), (GRID.x[0], GRID.y[0]), (GRID.x[-1], GRID.y[-1])]:
        assert bilinear(field, px, py, GRID) == pytest.approx(0.3 + 0.1 * px - 0.2 * py + 0.05 * px * py, abs=1e-12)
    assert bilinear(field, GRID.x[-1] + 0.01, 0.0, GRID) is None


def test_depth_and_position_of_a_shifted_disc():
    """The label's disc lies at the nominal centre (0, 0.2), which is a pixel's centre."""
    tip = np.array([0.0, 0.2, 1.1])
    score = score_press(7, disc(0.8, 0.2, 1.5), disc(0.0, 0.2, 1.5), tip, GRID)
    assert score.position_error == pytest.approx(0.8, abs=1e-9)
    assert score.centre_depth_error == pytest.approx(-0.1)
    assert not score.truncated


def test_the_reference_decides_about_truncation():
    tip = np.array([6.0, 0.0, 1.0])
    assert score_press(0, disc(0, 0, 1.5), disc(6.0, 0.0, 1.5), tip, GRID).truncated
    assert not score_press(0, disc(6.0, 0.0, 1.5), disc(0, 0, 1.5), tip, GRID).truncated


def test_an_empty_region_has_no_position():
    tip = np.array([0.0, 0.0, 1.0])
    missed = score_press(0, np.zeros(GRID.shape), disc(0, 0, 1.5), tip, GRID)
    assert missed.position_error is None
    assert missed.reference_region
    assert missed.centre_depth_error == pytest.approx(-1.0)
    assert not score_press(0, disc(0, 0, 1.5), disc(0, 0, 1.5, depth=0.4), tip, GRID).reference_region
