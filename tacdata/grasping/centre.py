"""Estimates the contact's centre on a fingertip, by its taxels or by the pixels of an estimated map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tacdata.sensor import Sensor

Maps = Callable[[np.ndarray], np.ndarray]
"""Tared readings (n, taxels) [counts] -> depth maps (n, pixels_x, pixels_y) [mm]."""
DEEP = 0.4
"""Depth from which a pixel counts as contact [mm] (paper)."""
TOUCHED = 100.0
"""Reading of the strongest taxel, averaged over the window, above which a contact is valid [counts]."""


def touched(frames: np.ndarray) -> bool:
    """Return whether tared readings (n, taxels) [counts] show a contact."""
    return bool(frames.mean(axis=0).max() > TOUCHED)


def raw_centre(frames: np.ndarray, sensor: Sensor) -> np.ndarray | None:
    """Return the centroid of the averaged readings, each over the largest [mm], shape (2,); None without contact."""
    if not touched(frames):
        return None
    # Below zero a taxel is unloaded, and would pull the centroid away from the contact.
    mean = np.maximum(frames.mean(axis=0), 0.0)
    share = mean / mean.max()
    return share @ sensor.taxels.centers / share.sum()


def dense_centre(frames: np.ndarray, sensor: Sensor, maps: Maps) -> np.ndarray | None:
    """Return the centroid of the pixels deeper than `DEEP` in the averaged map [mm], shape (2,).

    None without contact, or where no pixel is so deep.
    """
    return map_centre(maps(frames).mean(axis=0), sensor) if touched(frames) else None


def map_centre(depth: np.ndarray, sensor: Sensor) -> np.ndarray | None:
    """Return the centroid of a map's pixels deeper than `DEEP` [mm], shape (2,); None if there is none.

    Args:
        depth: Depth [mm], shape (pixels_x, pixels_y).
        sensor: The sensor of the map.
    """
    inside = depth > DEEP
    if not inside.any():
        return None
    i, j = np.nonzero(inside)
    return np.array([sensor.map.x[i].mean(), sensor.map.y[j].mean()])
