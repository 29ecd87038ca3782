"""The loss of the paper against values worked out by hand."""

import pytest
import torch

from tacdata.training.loss import WeightedLoss, normalized


def test_a_map_of_four_pixels_by_hand():
    """Labels 0, 0.3, 0.31, 1; errors 0.2, -0.1, 0.4, -0.5; weights 1, 1, 2, 2 (0.3 does not exceed 0.3).

    0.5 e^2 + 0.5 |e| = 0.12, 0.055, 0.28, 0.375; weighted sum
    0.12 + 0.055 + 0.56 + 0.75 = 1.485; over 4 pixels.
    """
    label = torch.tensor([[[0.0, 0.3], [0.31, 1.0]]], dtype=torch.float64)
    error = torch.tensor([[[0.2, -0.1], [0.4, -0.5]]], dtype=torch.float64)
    threshold_as_printed = WeightedLoss()
    assert float(threshold_as_printed(label + error, label)) == pytest.approx(1.485 / 4, abs=1e-12)


def test_the_threshold_holds_on_the_normalized_label():
    """0.3 of D_max = 3 mm is 0.9 mm: 0.8 mm is background, 1.0 mm is foreground."""
    label = normalized(torch.tensor([[[0.8, 1.0]]]), 3.0)
    only_left, only_right = torch.tensor([[[0.1, 0.0]]]), torch.tensor([[[0.0, 0.1]]])
    loss = WeightedLoss()
    assert float(loss(label + only_right, label)) == pytest.approx(2 * float(loss(label + only_left, label)), rel=1e-5)


def test_frames_are_averaged_not_summed():
    label = torch.zeros(1, 2, 2)
    one = WeightedLoss()(label + 0.1, label)
    many = WeightedLoss()((label + 0.1).repeat(7, 1, 1), label.repeat(7, 1, 1))
    assert float(many) == pytest.approx(float(one))


def test_labels_are_clipped_to_the_valid_range():
    assert normalized(torch.tensor([-0.5, 0.0, 1.5, 3.0, 4.0]), 3.0).tolist() == pytest.approx([0, 0, 0.5, 1, 1])
