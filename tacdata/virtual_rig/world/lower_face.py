"""A solid's lower surface as a table, for shapes without a quick formula.

Distances of surface files are too slow for a stream, and leaning shapes have no closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.indenters import Indenter

SPACING = 0.05
"""Spacing of the samples [mm]."""
FAR = 100.0
"""Height that marks "no solid here" [mm]."""


@dataclass(frozen=True)
class LowerFace:
    """Heights of a solid's lower surface over its lowest point."""

    extent: float
    """Largest horizontal distance of the solid from its axis [mm]."""
    heights: np.ndarray
    """Height over a square of twice the extent [mm], shape (n, n); ``FAR`` outside the solid."""

    @classmethod
    def upright(cls, indenter: Indenter) -> Self:
        """Sample an upright indenter."""
        x, y = _places(indenter.extent)
        return cls(indenter.extent, np.minimum(indenter.profile(x, y), FAR))

    @classmethod
    def of(cls, indenter: Indenter, yaw: float, tilt_x: float, tilt_y: float) -> Self:
        """Sample a turned indenter, from its surface's triangles: the lowest one at each position.

        Args:
            indenter: The shape.
            yaw: Rotation about its own axis [deg].
            tilt_x: Tilt of that axis about x [deg], applied after `tilt_y`.
            tilt_y: Tilt about y [deg].
        """
        surface = indenter.surface()
        turn = Rotation.from_euler("XYZ", [tilt_x, tilt_y, yaw], degrees=True)
        corners = turn.apply(np.asarray(surface.vertices))[np.asarray(surface.faces)]
        # A tilt changes which point is the lowest.
        corners[..., 2] -= corners[..., 2].min()
        extent = float(np.linalg.norm(corners[..., :2], axis=-1).max())
        x, y = _places(extent)
        heights = np.full(x.shape, FAR)
        for a, b, c in corners:
            low, high = (np.array(f((a, b, c), axis=0)) for f in (np.min, np.max))
            i, j = (
                slice(math.ceil((low[k] + extent) / SPACING), math.floor((high[k] + extent) / SPACING) + 1)
                for k in (0, 1)
            )
            heights[i, j] = np.minimum(heights[i, j], _over(a, b, c, x[i, j], y[i, j]))
        return cls(extent, heights)

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height [mm] at (x, y) [mm], interpolated linearly; `FAR` outside."""
        last = len(self.heights) - 1
        i, j = ((np.asarray(v) + self.extent) / SPACING for v in (x, y))
        outside = (i < 0) | (i > last) | (j < 0) | (j > last)
        a, b = (np.clip(np.floor(v).astype(int), 0, last - 1) for v in (i, j))
        s, t = np.clip(i - a, 0, 1), np.clip(j - b, 0, 1)
        h = self.heights
        low, high = (1 - t) * h[a, b] + t * h[a, b + 1], (1 - t) * h[a + 1, b] + t * h[a + 1, b + 1]
        return np.where(outside, FAR, (1 - s) * low + s * high)


def _places(extent: float) -> tuple[np.ndarray, np.ndarray]:
    line = -extent + SPACING * np.arange(math.ceil(2 * extent / SPACING) + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    return x, y


def _over(a: np.ndarray, b: np.ndarray, c: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of a triangle at positions, `FAR` outside it."""
    twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    # From above, an upright triangle has no area; its neighbours give the height.
    if abs(twice) < 1e-12:
        return np.full(x.shape, FAR)
    s = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / twice
    t = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / twice
    within = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
    return np.where(within, a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]), FAR)
