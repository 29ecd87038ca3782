"""The sharp edges of a tessellation, and the corners in which they meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.surfaces.smooth import CREASE

_CHUNK = 4_000_000
"""Pairs of a point and an edge per chunk; bounds the memory."""


@dataclass(frozen=True)
class Creases:
    """Sharp edges as straight segments."""

    ends: np.ndarray
    """Their ends [mm], shape (e, 2, 3)."""
    corners: np.ndarray
    """Points where not exactly two of them meet [mm], shape (c, 3)."""

    @staticmethod
    def of(vertices: np.ndarray, faces: np.ndarray, crease: float = CREASE) -> Creases:
        """Return the creases of a closed tessellation: vertices (v, 3) [mm], triangles (f, 3), angle [deg]."""
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        face = np.repeat(np.arange(len(faces)), 3)
        order = np.lexsort(edges.T)
        edges, face = edges[order].reshape(-1, 2, 2)[:, 0], face[order].reshape(-1, 2)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        sharp = edges[np.einsum("ei,ei->e", normal[face[:, 0]], normal[face[:, 1]]) < np.cos(np.radians(crease))]
        meet = np.bincount(sharp.ravel(), minlength=len(vertices))
        return Creases(vertices[sharp], vertices[(meet > 0) & (meet != 2)])

    def snapped(self, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return points moved to the crease or corner within reach, and which were moved.

        Args:
            points: Positions [mm], shape (n, 3).
            reach: Largest distance to a crease or corner [mm].
        """
        places, hits = points.copy(), np.zeros(len(points), dtype=bool)
        for ends in (self.ends, np.stack([self.corners, self.corners], axis=1)):
            if len(ends) == 0:
                continue
            rows = max(1, _CHUNK // len(ends))
            for start in range(0, len(points), rows):
                part = slice(start, start + rows)
                place, away = _nearest(points[part], ends)
                places[part][away < reach] = place[away < reach]
                hits[part] |= away < reach
        return places, hits


def _nearest(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    start, direction = ends[:, 0], ends[:, 1] - ends[:, 0]
    square = np.maximum(np.einsum("ei,ei->e", direction, direction), 1e-300)
    share = np.clip((points @ direction.T - np.einsum("ei,ei->e", start, direction)) / square, 0, 1)
    # |p - s - t a|^2 without an array of pairs times three.
    squares = np.zeros(share.shape)
    for k in range(3):
        squares += (points[:, k, None] - start[:, k] - share * direction[:, k]) ** 2
    best = squares.argmin(axis=1)
    rows = np.arange(len(points))
    return start[best] + share[rows, best, None] * direction[best], np.sqrt(squares[rows, best])
