"""The five metrics on maps small enough for paper and pencil, and what happens where they are undefined."""

import numpy as np
import pytest

from tacdata.training.metrics.depth_maps import centroid, score_frames, summarize


def one(prediction, label):
    return score_frames(np.array([prediction], dtype=np.float32), np.array([label], dtype=np.float32))


def test_a_map_of_six_pixels_by_hand():
    label = [[0.0, 0.4, 1.0], [0.0, 0.1, 0.2]]
    prediction = [[0.0, 0.2, 0.7], [0.3, 0.1, 0.05]]
    scores = one(prediction, label)
    # Differences 0, -0.2, -0.3, 0.3, 0, -0.15; squares sum to 0.04 + 0.09 + 0.09 + 0.0225 = 0.2425.
    assert scores.pixel_rmse[0] == pytest.approx(np.sqrt(0.2425 / 6), abs=1e-7)
    assert scores.peak_error[0] == pytest.approx(0.3, abs=1e-7)
    # In contact by the label: 0.4, 1.0, 0.2 (0.1 does not exceed 0.1); squares 0.04 + 0.09 + 0.0225 = 0.1525.
    assert scores.contact_rmse[0] == pytest.approx(np.sqrt(0.1525 / 3), abs=1e-7)
    # Masks share 2 pixels of 4.
    assert scores.iou[0] == pytest.approx(0.5)
    # Label: weights 0.4 at (0,1), 1.0 at (0,2), 0.2 at (1,2): (0.2, 2.8) / 1.6.
    # Prediction: 0.2 at (0,1), 0.7 at (0,2), 0.3 at (1,0): (0.3, 1.6) / 1.2.
    expected = np.hypot(0.2 / 1.6 - 0.3 / 1.2, 2.8 / 1.6 - 1.6 / 1.2)
    assert scores.centroid_error[0] == pytest.approx(expected, abs=1e-6)


def test_equal_maps_score_perfectly():
    label = np.random.default_rng(0).uniform(0, 2, (5, 35, 26)).astype(np.float32)
    scores = score_frames(label, label)
    assert not scores.pixel_rmse.any()
    assert not scores.contact_rmse.any()
    assert not scores.centroid_error.any()
    assert (scores.iou == 1).all()


EMPTY, PRESSED = [[0.0, 0.1], [0.05, 0.0]], [[0.0, 0.6], [0.0, 0.0]]


@pytest.mark.parametrize(
    ("prediction", "label", "defined", "iou"),
    [
        (PRESSED, PRESSED, {"contact_rmse", "centroid_error", "iou"}, 1.0),
        (EMPTY, PRESSED, {"contact_rmse", "iou"}, 0.0),
        (PRESSED, EMPTY, {"iou"}, 0.0),
        (EMPTY, EMPTY, set(), np.nan),
    ],
)
def test_what_is_defined_where_a_mask_is_empty(prediction, label, defined, iou):
    scores = one(prediction, label)
    for name in ("contact_rmse", "centroid_error", "iou"):
        assert np.isfinite(getattr(scores, name)[0]) == (name in defined), name
    assert np.isfinite(scores.pixel_rmse[0])
    assert np.isfinite(scores.peak_error[0])
    assert scores.iou[0] == pytest.approx(iou, nan_ok=True)


def test_undefined_frames_are_left_out_and_counted():
    summary = summarize(np.array([1.0, np.nan, 2.0, 3.0, np.nan, 10.0]))
    assert (summary.count, summary.left_out) == (4, 2)
    assert summary.median == pytest.approx(2.5)
    assert summary.mean == pytest.approx(4.0)
    # Deviations -3, -2, -1, 6: squares sum to 50, over n - 1 = 3.
    assert summary.sd == pytest.approx(np.sqrt(50 / 3))
    # Position 0.9 * 3 = 2.7 between 3 and 10.
    assert summary.p90 == pytest.approx(3 + 0.7 * 7)


def test_a_summary_of_nothing_says_so():
    summary = summarize(np.array([np.nan]))
    assert (summary.median, summary.sd, summary.count, summary.left_out) == (None, None, 0, 1)
    assert summarize(np.array([2.0])).sd is None


def test_geometric_and_weighted_centroids_differ():
    depth = np.zeros((1, 4, 3))
    depth[0, 0, 0], depth[0, 2, 0] = 0.5, 1.5
    assert centroid(depth, 0.1)[0] == pytest.approx((1.5, 0.0))
    assert centroid(depth, 0.1, weighted=False)[0] == pytest.approx((1.0, 0.0))
