"""Overlap after alignment: place does not count, shape and size do."""

import numpy as np
import pytest

from tacdata.training.metrics.overlap import aligned_iou


def disc(cx, cy, radius):
    i, j = np.meshgrid(np.arange(35), np.arange(26), indexing="ij")
    return np.where((i - cx) ** 2 + (j - cy) ** 2 <= radius**2, 1.0, 0.0)


def test_a_shifted_region_overlaps_wholly():
    assert aligned_iou(disc(20, 15, 5), disc(12, 10, 5)) == 1.0


def test_a_smaller_region_overlaps_by_its_area():
    ours, theirs = disc(20, 15, 4), disc(12, 10, 6)
    assert aligned_iou(ours, theirs) == pytest.approx(ours.sum() / theirs.sum())


def test_two_squares_by_hand():
    """3 x 3 pixels against 5 x 3 pixels about one centre share 9 of 15."""
    ours, theirs = np.zeros((35, 26)), np.zeros((35, 26))
    ours[3:6, 4:7], theirs[20:25, 10:13] = 1.0, 1.0
    assert aligned_iou(ours, theirs) == pytest.approx(9 / 15)


def test_an_empty_region_has_no_overlap():
    assert aligned_iou(np.zeros((35, 26)), disc(12, 10, 5)) is None
    assert aligned_iou(disc(12, 10, 5), disc(12, 10, 5) * 0.3) is None
