"""Quadratic tetrahedra and triangles: shape functions and quadrature.

Node order of both: corners first, then the mid-sides of the edges in `EDGES` / `FACE_EDGES`.
"""

from __future__ import annotations

import numpy as np

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
"""Edges of a tetrahedron that carry nodes 4 to 9."""

FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
"""Faces of a tetrahedron, corners counter-clockwise seen from outside."""

FACE_EDGES = ((0, 1), (1, 2), (2, 0))
"""Edges of a triangle that carry nodes 3 to 5."""


def tetrahedron_gradients(points: np.ndarray) -> np.ndarray:
    """Return reference gradients of the 10 shape functions.

    Args:
        points: Barycentric coordinates 1 to 3 (xi, eta, zeta) [1], shape (q, 3).

    Returns:
        dN/d(xi, eta, zeta) [1], shape (q, 10, 3).
    """
    barycentric = np.concatenate([1 - points.sum(axis=1, keepdims=True), points], axis=1)
    slopes = np.concatenate([-np.ones((1, 3)), np.eye(3)])
    corners = (4 * barycentric - 1)[:, :, None] * slopes
    edges = [4 * (barycentric[:, a, None] * slopes[b] + barycentric[:, b, None] * slopes[a]) for a, b in EDGES]
    return np.concatenate([corners, np.stack(edges, axis=1)], axis=1)


def tetrahedron_quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Return the 4-point rule, exact to degree 2: points (4, 3) and weights (4,) that sum to 1/6."""
    a, b = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
    points = np.full((4, 3), a)
    # The first point is near corner 0, whose barycentric coordinate is not among the three.
    points[1:][np.eye(3, dtype=bool)] = b
    return points, np.full(4, 1 / 24)


def triangle_shapes(points: np.ndarray) -> np.ndarray:
    """Return the 6 shape functions at (xi, eta) [1], shape (q, 2), as an array of shape (q, 6)."""
    x, y = points[:, 0], points[:, 1]
    b = np.stack([1 - x - y, x, y], axis=-1)
    corners = b * (2 * b - 1)
    edges = np.stack([4 * b[:, i] * b[:, j] for i, j in FACE_EDGES], axis=-1)
    return np.concatenate([corners, edges], axis=-1)


def triangle_gradients(points: np.ndarray) -> np.ndarray:
    """Return d(shape)/d(xi, eta) [1], shape (q, 6, 2), at points of shape (q, 2)."""
    x, y = points[:, 0], points[:, 1]
    b = np.stack([1 - x - y, x, y], axis=-1)
    slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corners = (4 * b - 1)[:, :, None] * slopes
    edges = [4 * (b[:, i, None] * slopes[j] + b[:, j, None] * slopes[i]) for i, j in FACE_EDGES]
    return np.concatenate([corners, np.stack(edges, axis=1)], axis=1)


def triangle_hats(points: np.ndarray) -> np.ndarray:
    """Return the piecewise linear hats of a quadratic triangle's six nodes at (xi, eta) [1], shape (q, 2), as (q, 6).

    >>> import numpy as np
    >>> from tacdata.skin.mesh.elements import triangle_hats
    >>> triangle_hats(np.array([[0.5, 0.0], [0.25, 0.25]])).tolist()
    [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 0.0, 0.5]]
    """
    x, y = points[:, 0], points[:, 1]
    barycentric = np.stack([1 - x - y, x, y], axis=-1)
    result = np.zeros((len(points), 6))
    at_corner = barycentric > 0.5
    corners = np.maximum(2 * barycentric - 1, 0.0)
    result[:, :3] = corners
    for node, (a, b) in enumerate(FACE_EDGES, start=3):
        c = 3 - a - b
        middle = 1 - 2 * barycentric[:, c]
        shared = np.where(at_corner[:, a], 2 * barycentric[:, b], np.where(at_corner[:, b], 2 * barycentric[:, a], 0.0))
        result[:, node] = np.where(at_corner.any(axis=1), shared, middle)
    return result


def triangle_quadrature(subdivisions: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the 6-point rule of degree 4 (Dunavant 1985), repeated on ``subdivisions``^2 congruent sub-triangles.

    Returns:
        Points (q, 2) and weights (q,) that sum to 1/2.
    """
    a, wa = 0.445948490915965, 0.223381589678011
    b, wb = 0.091576213509771, 0.109951743655322
    points = np.array([[a, a], [1 - 2 * a, a], [a, 1 - 2 * a], [b, b], [1 - 2 * b, b], [b, 1 - 2 * b]])
    weights = np.array([wa] * 3 + [wb] * 3) / 2
    n = subdivisions
    all_points, all_weights = [], []
    for i in range(n):
        for j in range(n - i):
            all_points.append((points + np.array([i, j])) / n)
            all_weights.append(weights / n**2)
            if i + j < n - 1:
                # Sub-triangles that point the other way get the rule rotated by half a turn.
                all_points.append((np.array([i + 1, j + 1]) - points) / n)
                all_weights.append(weights / n**2)
    return np.concatenate(all_points), np.concatenate(all_weights)
