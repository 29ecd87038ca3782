"""Overlap of two contact regions with their difference in place taken out (paper, section on structure design).

The paper gives the centroid-aligned IoU of 57 presses with a triangular indenter worn by 12 participants, and prints
neither threshold nor alignment. Here: both regions are pixels deeper than 0.4 mm, the paper's representative
threshold; the map under test is shifted by the difference of the geometric centroids, bilinearly between pixels.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from tacdata.training.metrics.depth_maps import centroid
from tacdata.training.metrics.physical import REGION_THRESHOLD


def aligned_iou(depth: np.ndarray, reference: np.ndarray, threshold: float = REGION_THRESHOLD) -> float | None:
    """Return the IoU of two regions after alignment [1]; None if one of them is empty.

    Args:
        depth: Map under test [mm], shape (pixels_x, pixels_y).
        reference: The map that it is laid over [mm], same shape.
        threshold: Depth above which a pixel belongs to a region [mm].
    """
    ours, theirs = depth > threshold, reference > threshold
    if not (ours.any() and theirs.any()):
        return None
    shift = (
        centroid(reference[None], threshold, weighted=False)[0] - centroid(depth[None], threshold, weighted=False)[0]
    )
    # By fractions of a pixel: half a pixel matters in a small region.
    shifted = ndimage.shift(depth.astype(np.float64), shift, order=1, mode="constant", cval=0.0) > threshold
    union = (shifted | theirs).sum()
    return float((shifted & theirs).sum() / union) if union else None
