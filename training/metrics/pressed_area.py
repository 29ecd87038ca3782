"""Area of the map over which presses were recorded: outside of it intervals are wider.

Presses left out of training lie where others do. So their errors tell nothing of contacts beyond. There, an interval is
wider by a factor that grows with the distance. The factor is no measurement of the unit at hand: it was set on one rig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD

WIDEST = 2.75
"""Factor of an interval far outside [1]; set on rig 20, fits to 8, 30 and 96 presses without the edge: 68 % intervals
held 72, 66 and 62 % there."""
RAMP = 0.5
"""Distance outside over which the factor grows to `WIDEST` [mm]; set with it."""


@dataclass(frozen=True)
class PressedArea:
    """A rectangle around the deepest pixels of presses."""

    low: tuple[float, float]
    """Its corner with the smallest x and y [mm], from the map's centre."""
    high: tuple[float, float]
    """Its corner with the largest x and y [mm]."""

    def widening(self, depth: np.ndarray, pitch: float) -> np.ndarray:
        """Return the factor of each map's intervals [1], shape (n,): 1 for contacts inside.

        Args:
            depth: Maps [mm], shape (n, pixels_x, pixels_y).
            pitch: Distance of pixels [mm].
        """
        place = deepest(depth, pitch)
        outside = np.maximum(np.maximum(self.low - place, place - self.high), 0.0)
        share = np.minimum(np.hypot(*outside.T) / RAMP, 1.0)
        return np.where(depth.max(axis=(1, 2)) > CONTACT_THRESHOLD, 1.0 + (WIDEST - 1.0) * share, 1.0)


def deepest(depth: np.ndarray, pitch: float) -> np.ndarray:
    """Return the place of each map's deepest pixel from the map's centre [mm], shape (n, 2)."""
    pixel = np.stack(np.unravel_index(depth.reshape(len(depth), -1).argmax(axis=1), depth.shape[1:]), axis=1)
    return (pixel - (np.array(depth.shape[1:]) - 1) / 2) * pitch


def pressed_area(labels: Sequence[np.ndarray], pitch: float) -> PressedArea | None:
    """Return the area of some presses; None if fewer than two touch.

    The extremes of n places drawn evenly from a range fall short of its ends by about 1 / (n - 1) of their distance.

    Args:
        labels: Labels of each press [mm], shape (n, pixels_x, pixels_y).
        pitch: Distance of pixels [mm].
    """
    touching = [label[label.max(axis=(1, 2)) > CONTACT_THRESHOLD] for label in labels]
    places = [deepest(label, pitch) for label in touching if len(label)]
    if len(places) < 2:
        return None
    together = np.concatenate(places)
    low, high = together.min(axis=0), together.max(axis=0)
    # Of n places drawn at random the extremes miss their range by about an n-th of it.
    margin = (high - low) / (len(places) - 1)
    (x, y), (right, top) = (low - margin).tolist(), (high + margin).tolist()
    return PressedArea((x, y), (right, top))
