"""Agreement of predicted and labelled depth maps, frame by frame (paper, Exp. 1).

Empty masks. The paper does not define its formulas for empty masks. Here:

- pixel RMSE and peak error are defined for every frame;
- contact-region RMSE needs contact in the label;
- the centroid error needs contact in both; a frame whose contact the network missed has none, and is counted;
- IoU needs contact in either; if only one has it, IoU is 0.

Where a metric is undefined the value is NaN; `summarize` leaves those frames out and counts them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

CONTACT_THRESHOLD = 0.1
"""tau: a pixel is in contact if its depth exceeds this [mm] (paper, Exp. 1)."""


@dataclass(frozen=True)
class FrameScores:
    """The five metrics of every frame; NaN where one is undefined."""

    pixel_rmse: np.ndarray
    """Root mean square error over all pixels [mm], shape (n,)."""
    peak_error: np.ndarray
    """Absolute difference of the largest depths [mm], shape (n,)."""
    contact_rmse: np.ndarray
    """Root mean square error over the label's contact region [mm], shape (n,)."""
    centroid_error: np.ndarray
    """Distance of the depth-weighted centroids [px], shape (n,)."""
    iou: np.ndarray
    """Intersection over union of the contact regions [1], shape (n,)."""
    labelled: np.ndarray
    """The label has contact [bool], shape (n,)."""
    predicted: np.ndarray
    """The prediction has contact [bool], shape (n,)."""

    def where(self, mask: np.ndarray) -> FrameScores:
        """Return the scores of the frames that ``mask`` picks (mask or indices)."""
        return FrameScores(*(getattr(self, f.name)[mask] for f in fields(self)))


@dataclass(frozen=True)
class MetricSummary:
    """A metric over many frames."""

    median: float | None
    """Median; None if no frame defines the metric, as below."""
    p90: float | None
    """90th percentile, linear between order statistics."""
    mean: float | None
    """Mean."""
    sd: float | None
    """Sample standard deviation (n - 1); None for fewer than two frames."""
    count: int
    """Frames that define the metric."""
    left_out: int
    """Frames that do not."""


def score_frames(prediction: np.ndarray, label: np.ndarray, threshold: float = CONTACT_THRESHOLD) -> FrameScores:
    """Compare depth maps [mm], both of shape (n, pixels_x, pixels_y).

    Args:
        prediction: Predicted depth.
        label: Labelled depth.
        threshold: Depth above which a pixel is in contact [mm].

    Example:
        >>> import numpy as np
        >>> from tacdata.training.metrics.depth_maps import score_frames
        >>> label = np.zeros((1, 35, 26), np.float32)
        >>> label[0, 15:20, 10:15] = 1.0  # mm
        >>> scores = score_frames(0.8 * label, label)
        >>> float(scores.peak_error[0].round(3)), float(scores.iou[0])
        (0.2, 1.0)
    """
    n, pixels = len(label), int(np.prod(label.shape[1:]))
    p = prediction.reshape(n, pixels).astype(np.float64)
    q = label.reshape(n, pixels).astype(np.float64)
    # Compared in the maps' own precision: a pixel of exactly 0.1 mm does not exceed 0.1 mm, float32 or not.
    in_p, in_q = prediction.reshape(n, pixels) > threshold, label.reshape(n, pixels) > threshold
    squared = (p - q) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        contact = np.sqrt((squared * in_q).sum(axis=1) / in_q.sum(axis=1))
        iou = (in_p & in_q).sum(axis=1) / (in_p | in_q).sum(axis=1)
    distance = np.linalg.norm(centroid(prediction, threshold) - centroid(label, threshold), axis=1)
    return FrameScores(
        pixel_rmse=np.sqrt(squared.mean(axis=1)),
        peak_error=np.abs(p.max(axis=1) - q.max(axis=1)),
        contact_rmse=contact,
        centroid_error=distance,
        iou=iou,
        labelled=in_q.sum(axis=1) > 0,
        predicted=in_p.sum(axis=1) > 0,
    )


def centroid(depth: np.ndarray, threshold: float, weighted: bool = True) -> np.ndarray:
    """Return the centroid [px] of the region deeper than ``threshold`` [mm], shape (n, 2); NaN where none.

    Args:
        depth: Depth maps [mm], shape (n, pixels_x, pixels_y).
        threshold: Depth above which a pixel belongs to the region [mm].
        weighted: Weight pixels by depth (paper, eq. of e_cent), or equally (geometric centroid).
    """
    region = depth > threshold
    weight = np.where(region, depth if weighted else 1.0, 0.0).astype(np.float64)
    i, j = np.arange(depth.shape[1]), np.arange(depth.shape[2])
    total = weight.sum(axis=(1, 2))
    moments = np.stack([weight.sum(axis=2) @ i, weight.sum(axis=1) @ j], axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return moments / total[:, None]


def summarize(values: np.ndarray) -> MetricSummary:
    """Summarize a metric, shape (n,); frames where it is NaN are left out and counted."""
    finite = values[np.isfinite(values)]
    left_out = len(values) - len(finite)
    if not len(finite):
        return MetricSummary(None, None, None, None, 0, left_out)
    sd = float(finite.std(ddof=1)) if len(finite) > 1 else None
    return MetricSummary(
        float(np.median(finite)), float(np.percentile(finite, 90)), float(finite.mean()), sd, len(finite), left_out
    )
