"""Agreement with the prescribed contact, one value a press (paper, Exp. 1, physical evaluation)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.sensor import DepthMap
from tacdata.training.metrics.depth_maps import centroid

REGION_THRESHOLD = 0.4
"""Depth above which a pixel belongs to the contact region [mm] (paper, section on labels)."""


@dataclass(frozen=True)
class PressScore:
    """One press at full depth."""

    episode: int
    """The episode's number."""
    centre_depth_error: float | None
    """Depth of the map at the nominal centre minus the nominal depth [mm]; None off the map."""
    position_error: float | None
    """Distance of the region's centroid from the nominal centre [mm]; None if either region is empty."""
    reference_region: bool
    """The reference map has a region above the threshold."""
    truncated: bool
    """The reference region touches the map's border, so that its centroid is biased."""


def score_press(
    episode: int,
    depth: np.ndarray,
    reference: np.ndarray,
    tip: np.ndarray,
    grid: DepthMap,
    threshold: float = REGION_THRESHOLD,
) -> PressScore:
    """Compare the map of one press at full depth with its prescribed contact.

    Args:
        episode: The episode's number.
        depth: Depth map under test [mm], shape (pixels_x, pixels_y).
        reference: Labelled map [mm], same shape; it alone decides about truncation.
        tip: Nominal x, y and depth of the lowest point [mm], shape (3,).
        grid: The sensor's pixel grid.
        threshold: Depth above which a pixel belongs to the region [mm].
    """
    region = reference > threshold
    # A region cut by the map's edge has its centroid elsewhere than its contact.
    border = np.concatenate([region[0], region[-1], region[:, 0], region[:, -1]])
    at_centre = bilinear(depth, tip[0], tip[1], grid)
    position = None
    if region.any() and (depth > threshold).any():
        pixel = centroid(depth[None], threshold, weighted=False)[0]
        middle = (np.array(grid.shape) - 1) / 2
        position = float(np.linalg.norm((pixel - middle) * grid.pixel_pitch - tip[:2]))
    return PressScore(
        episode=episode,
        position_error=position,
        reference_region=bool(region.any()),
        truncated=bool(border.any()),
        centre_depth_error=None if at_centre is None else at_centre - float(tip[2]),
    )


def bilinear(depth: np.ndarray, x: float, y: float, grid: DepthMap) -> float | None:
    """Return the depth [mm] at (x, y) [mm, sensor frame] between four pixel centres; None off the map."""
    i = float(x) / grid.pixel_pitch + (grid.pixels_x - 1) / 2
    j = float(y) / grid.pixel_pitch + (grid.pixels_y - 1) / 2
    if not (0 <= i <= grid.pixels_x - 1 and 0 <= j <= grid.pixels_y - 1):
        return None
    # A point on the last pixel centre belongs to the cell before it.
    i0, j0 = min(int(i), grid.pixels_x - 2), min(int(j), grid.pixels_y - 2)
    u, v = i - i0, j - j0
    corner = depth[i0 : i0 + 2, j0 : j0 + 2].astype(np.float64)
    return float(np.array([1 - u, u]) @ corner @ np.array([1 - v, v]))
