"""The smooth surface behind a tessellation: quadratic edges from vertex normals, creases kept.

CAD programs put vertices on the true surface and chords between them. Every edge that is no crease gets the arc of the
parabola with the end normals' slopes (Nagata 2005). The smaller of the two ends' is used, so that a flat next to a
fillet does not bulge. Triangles become quadratic and are divided until their chord error is small enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

CREASE = 30.0
"""Angle between neighbouring triangles from which their edge counts as sharp [deg]."""

_MOST = 16
"""Largest number of parts of an edge."""

_PLANE = 0.02
"""Angle between neighbouring triangles below which they lie in one plane [deg]."""

_WIDE = 3.0
"""Width of a plane part over that of its neighbours from which it counts as flat [1]."""


@dataclass(frozen=True)
class Smooth:
    """A tessellation with curved edges."""

    vertices: np.ndarray
    """Its vertices [mm], shape (v, 3)."""
    faces: np.ndarray
    """Its triangles, shape (f, 3), int64."""
    middles: np.ndarray
    """Smooth surface's points at the middle of each triangle's edges 01, 12, 20 [mm], shape (f, 3, 3)."""

    @property
    def rise(self) -> np.ndarray:
        """Height of each edge's arc over its chord [mm], shape (f, 3)."""
        corners = self.vertices[self.faces]
        return np.linalg.norm(self.middles - (corners + np.roll(corners, -1, axis=1)) / 2, axis=-1)

    def divided(self, chord: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a finer tessellation: vertices (n, 3) [mm], triangles (m, 3), and the parent of each, shape (m,).

        Args:
            chord: Largest remaining height of an arc over its chord [mm].
        """
        # One number for all: neighbours must agree on the parts of the edge between them.
        parts = int(np.clip(np.ceil(np.sqrt(self.rise.max(initial=0.0) / chord)), 1, _MOST))
        i, j = (g.ravel() for g in np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij"))
        keep = i + j <= parts
        i, j = i[keep], j[keep]
        number = {pair: k for k, pair in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
        cells = []
        for a, b in number:
            if a + b < parts:
                cells.append((number[a, b], number[a + 1, b], number[a, b + 1]))
            if a + b < parts - 1:
                cells.append((number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]))
        x, y = i / parts, j / parts
        w = 1 - x - y
        corners = self.vertices[self.faces]
        shapes = np.stack([w * (2 * w - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * w * x, 4 * x * y, 4 * y * w], axis=-1)
        points = np.einsum("ka,fai->fki", shapes, np.concatenate([corners, self.middles], axis=1))
        faces = np.array(cells)[None] + len(i) * np.arange(len(self.faces))[:, None, None]
        return points.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(np.arange(len(self.faces)), len(cells))


@dataclass(frozen=True)
class _Edges:
    """The edges of a closed tessellation."""

    corner: np.ndarray
    """Corner 3 f + k from which the edge leaves in each of its two triangles, shape (e, 2)."""
    soft: np.ndarray
    """True where the surface passes smoothly, shape (e,)."""
    turn: np.ndarray
    """Angle between the triangles [deg], shape (e,)."""
    length: np.ndarray
    """Length [mm], shape (e,)."""


def smooth(vertices: np.ndarray, faces: np.ndarray, crease: float = CREASE) -> Smooth:
    """Return the smooth surface behind a closed tessellation.

    Args:
        vertices: Positions [mm], shape (v, 3).
        faces: Triangles, normals outward, every edge shared by two, shape (f, 3).
        crease: Angle from which an edge is sharp [deg].
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    normals = cross / np.maximum(2 * area, 1e-300)[:, None]
    edges = _edges(vertices, faces, normals, crease)
    tilt = _corner_normals(normals, _angles(corners), _flat(area, edges), edges)
    first, second = edges.corner.T
    # The edge runs from the first triangle's corner to the second's, where that one leaves in the other direction.
    start, end = faces.ravel()[first], faces.ravel()[second]
    direction = (vertices[end] - vertices[start]) / np.maximum(edges.length, 1e-300)[:, None]
    up = normals[first // 3] + normals[second // 3]
    up -= np.einsum("ei,ei->e", up, direction)[:, None] * direction
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
    rising = -_slope(tilt[first], direction, up)
    falling = _slope(tilt[second], direction, up)
    # A parabola with end slopes s rises by a quarter of s times its length.
    slope = np.where(rising * falling > 0, np.sign(rising) * np.minimum(np.abs(rising), np.abs(falling)), 0.0)
    rise = np.where(edges.soft, 0.25 * slope * edges.length, 0.0)
    middles = np.empty((3 * len(faces), 3))
    middles[first] = middles[second] = (vertices[start] + vertices[end]) / 2 + rise[:, None] * up
    return Smooth(vertices, faces, middles.reshape(-1, 3, 3))


def _edges(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, crease: float) -> _Edges:
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    order = np.lexsort(np.sort(ends, axis=1).T)
    corner = order.reshape(-1, 2)
    a, b = normals[corner[:, 0] // 3], normals[corner[:, 1] // 3]
    # By the chord between the normals: an arc cosine cannot tell small angles from none.
    turn = np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2, 0, 1)))
    length = np.linalg.norm(vertices[ends[corner[:, 0], 1]] - vertices[ends[corner[:, 0], 0]], axis=1)
    return _Edges(corner, turn < crease, turn, length)


def _angles(corners: np.ndarray) -> np.ndarray:
    """Return the angle at every corner of triangles (f, 3, 3) [rad], shape (3 f,)."""
    forward, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(forward, back), axis=-1)
    return np.arctan2(sine, np.einsum("fki,fki->fk", forward, back)).ravel()


def _corner_normals(normals: np.ndarray, angle: np.ndarray, flat: np.ndarray, edges: _Edges) -> np.ndarray:
    """Return the smooth surface's unit normal at every corner of every triangle, shape (3 f, 3).

    Triangles around a vertex between two creases share one normal, weighted by their angles (Thuermer and Wuethrich
    1998). Flat parts impose theirs.
    """
    first, second = edges.corner[edges.soft].T
    forward = [corner - corner % 3 + (corner + 1) % 3 for corner in (first, second)]
    links = np.concatenate([np.stack([first, forward[1]]), np.stack([forward[0], second])], axis=1)
    group = _components(3 * len(normals), links)
    weight = np.where(np.repeat(flat, 3), 1e12, 1.0) * angle
    total = np.zeros((group.max() + 1, 3))
    np.add.at(total, group, np.repeat(normals, 3, axis=0) * weight[:, None])
    return (total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))[group]


def _flat(area: np.ndarray, edges: _Edges) -> np.ndarray:
    """Return which triangles lie in plane parts much wider than their smooth neighbours, shape (f,)."""
    faces = edges.corner // 3
    region = _components(len(area), faces[edges.turn < _PLANE].T)
    count = region.max() + 1
    inner = region[faces[:, 0]] == region[faces[:, 1]]
    side = region[faces[~inner]]
    length = np.repeat(edges.length[~inner, None], 2, axis=1)
    width = 4 * np.bincount(region, area, count) / np.maximum(np.bincount(side.ravel(), length.ravel(), count), 1e-300)
    soft = edges.soft[~inner]
    neighbours = np.bincount(side[soft].ravel(), (length * width[side[:, ::-1]])[soft].ravel(), count)
    shared = np.bincount(side[soft].ravel(), length[soft].ravel(), count)
    return ((shared > 0) & (width * shared > _WIDE * neighbours))[region]


def _components(count: int, links: np.ndarray) -> np.ndarray:
    """Return the number of the connected component of each of ``count`` nodes; ``links`` is (2, n)."""
    graph = coo_matrix((np.ones(links.shape[1]), (links[0], links[1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _slope(normal: np.ndarray, direction: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return n . along / n . up of normals, shape (e,)."""
    return np.einsum("ei,ei->e", normal, direction) / np.maximum(np.einsum("ei,ei->e", normal, up), 0.1)
