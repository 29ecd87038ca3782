"""The signed distance of a solid as a smooth function: cubic B-splines on a grid, fitted to exact distances.

Distances are exact to the smooth surface behind the tessellation (`tacdata.surfaces.smooth`) in a band around it;
further away they are interpolated from a coarser grid. The spline is twice continuously differentiable, so that
normals carry no noise of facets; sharp edges are rounded by about a spacing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import affine_transform, map_coordinates, spline_filter

from tacdata.surfaces.nearest import Nearest
from tacdata.surfaces.smooth import smooth

NODES = 2_000_000
"""Nodes that a grid may have; 8 MB in single precision."""

FINEST = 0.04
"""Spacing below which no grid goes [mm]."""

CHORD = 1e-4
"""Height of arcs over chords of the smooth surface that may remain [mm]."""

_COARSE = 4
"""Spacing of the coarse grid over that of the fine one."""

_BAND = 5
"""Half width of the band with exact distances, in spacings."""

MARGIN = 0.4
"""How far the grid reaches beyond the solid [mm]."""


@dataclass(frozen=True)
class DistanceGrid:
    """A signed distance [mm] as a cubic B-spline."""

    coefficients: np.ndarray
    """Of the splines at the nodes [mm], shape (nx, ny, nz), float32."""
    origin: np.ndarray
    """Place of the first node [mm], shape (3,)."""
    spacing: float
    """Distance between nodes [mm]."""

    @property
    def low(self) -> np.ndarray:
        """Lower corner of the box in which the spline is evaluated [mm], shape (3,)."""
        return self.origin + 2 * self.spacing

    @property
    def high(self) -> np.ndarray:
        """Upper corner of that box [mm], shape (3,)."""
        return self.origin + (np.array(self.coefficients.shape) - 3) * self.spacing

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance [mm], shape (n,), at points (n, 3) [mm]; outside the box, a lower bound."""
        inside = np.clip(points, self.low, self.high)
        # Above the box the solid is taken to go on as a column.
        outside = _length(points - inside)
        solid = _length(points - np.clip(points, self.low + MARGIN, self.high - MARGIN))
        place = ((inside - self.origin) / self.spacing).T
        d = map_coordinates(self.coefficients, place, order=3, prefilter=False, output=np.float64)
        return np.where(outside > 0, np.maximum(np.hypot(np.maximum(d, 0.0), outside), solid), d)


def _length(offset: np.ndarray) -> np.ndarray:
    """Length of offsets from a box [mm], shape (n, 3), above which a column goes on."""
    return np.linalg.norm(np.column_stack([offset[:, :2], np.minimum(offset[:, 2], 0.0)]), axis=1)


def distance_grid(vertices: np.ndarray, faces: np.ndarray, top: float) -> DistanceGrid:
    """Fit the signed distance of a solid, up to a height.

    Args:
        vertices: Of its closed surface [mm], shape (v, 3).
        faces: Triangles, normals outward, shape (f, 3).
        top: Height above which the solid does not matter [mm].
    """
    points, triangles, _ = smooth(vertices, faces).divided(CHORD)
    nearest = Nearest(points, triangles)
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    high[2] = min(high[2], top)
    spacing = max(FINEST, float(np.prod(high - low) / NODES) ** (1 / 3))
    # Two nodes beyond the box on each side: the support of a cubic spline.
    origin = low - 2 * spacing
    count = _COARSE * np.ceil((high - origin + 3 * spacing) / (_COARSE * spacing)).astype(int) + 1
    wide = nearest.places(_nodes(origin, _COARSE * spacing, (count - 1) // _COARSE + 1)).distance
    cells = (count - 1) // _COARSE
    coarse = wide.reshape(cells + 1)
    d = np.array(affine_transform(coarse, np.full(3, 1 / _COARSE), output_shape=tuple(count), order=1))
    near = np.flatnonzero(np.abs(d) < (_BAND + 1) * spacing)
    index = np.stack(np.unravel_index(near, tuple(count)), axis=-1)
    d.ravel()[near] = nearest.places(origin + spacing * index).distance
    return DistanceGrid(spline_filter(d, order=3, mode="mirror").astype(np.float32), origin, spacing)


def _nodes(origin: np.ndarray, spacing: float, count: np.ndarray) -> np.ndarray:
    axes = [origin[k] + spacing * np.arange(count[k]) for k in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
