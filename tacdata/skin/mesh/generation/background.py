"""The field of target edge lengths that fTetWild grades the mesh by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tacdata.sensor import Skin
from tacdata.skin.mesh.generation.settings import MeshSettings

_STEP = 0.5
"""Spacing of the background mesh [mm]."""


def background(
    skin: Skin, settings: MeshSettings, below: Callable[[np.ndarray], np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a background mesh that carries the target edge length: points [mm], tetrahedra, values [mm].

    Args:
        skin: Sizes that it covers.
        settings: Target edge lengths.
        below: Distance of points (n, 3) from the outer face [mm]; None: from the plane z = thickness.
    """
    axes = [
        np.arange(-skin.size_x / 2 - _STEP, skin.size_x / 2 + 1.5 * _STEP, _STEP),
        np.arange(-skin.size_y / 2 - _STEP, skin.size_y / 2 + 1.5 * _STEP, _STEP),
        np.arange(-skin.protrusion_tip - _STEP, skin.thickness + 1.5 * _STEP, _STEP / 2),
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    flat = points.reshape(-1, 3)
    depth = below(flat) if below else skin.thickness - flat[:, 2]
    return flat, _cubes(points.shape[:3]), edge_length(skin, settings, flat, depth)


def edge_length(skin: Skin, settings: MeshSettings, points: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return the target edge length [mm], shape (n,), at points (n, 3) that lie ``below`` [mm] the outer face."""
    blend = np.clip(below / (0.5 * skin.thickness), 0, 1)
    size = settings.outer + (settings.interior - settings.outer) * blend
    if skin.protrusion_radius:
        size = np.where(points[:, 2] < 0.3, np.minimum(size, settings.protrusion), size)
    if settings.focus:
        x, y, radius, fine, *hole = settings.focus
        from_middle = np.hypot(points[:, 0] - x, points[:, 1] - y)
        away = np.maximum(from_middle - radius, 0)
        if hole:
            away = np.maximum(away, hole[0] - from_middle)
        # Edges grow slowly away from the focus: neighbours of very different size are slivers.
        size = np.minimum(size, fine + 0.5 * np.hypot(away, np.maximum(below, 0)))
    return size


def _cubes(n: tuple[int, ...]) -> np.ndarray:
    """Return the tetrahedra of a grid of n points, every cube cut into six (Kuhn), shape (e, 4), int32."""
    index = np.arange(np.prod(n)).reshape(n)
    corner = {
        bits: index[bits[0] : n[0] - 1 + bits[0], bits[1] : n[1] - 1 + bits[1], bits[2] : n[2] - 1 + bits[2]].ravel()
        for bits in np.ndindex(2, 2, 2)
    }
    # The six monotone paths from corner 000 to corner 111.
    cells = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        bits, path = [0, 0, 0], [corner[0, 0, 0]]
        for axis in order:
            bits[axis] = 1
            path.append(corner[bits[0], bits[1], bits[2]])
        cells.append(np.stack(path, axis=-1))
    return np.concatenate(cells).astype(np.int32)
