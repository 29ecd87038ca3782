"""Tetrahedra, their boundary and their mid-side nodes, without any geometry of a sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.skin.mesh import elements


def volumes(vertices: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return the signed volume of each tetrahedron by its corners [mm^3], shape (e,)."""
    a, b, c, d = (vertices[tets[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def oriented(vertices: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices that are used and the tetrahedra with positive volume."""
    used, tets = np.unique(tets, return_inverse=True)
    vertices, tets = vertices[used].copy(), tets.reshape(-1, 4)
    flip = volumes(vertices, tets) < 0
    tets[flip] = tets[flip][:, [0, 2, 1, 3]]
    return vertices, tets


def boundary(tets: np.ndarray) -> np.ndarray:
    """Return the triangles that belong to one tetrahedron only, normals outward, shape (f, 3)."""
    faces = tets[:, elements.FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


@dataclass(frozen=True)
class Quadratic:
    """Straight-sided tetrahedra with mid-side nodes."""

    nodes: np.ndarray
    """Corners, then mid-sides [mm], shape (n, 3)."""
    tets: np.ndarray
    """Nodes of each tetrahedron, shape (e, 10), int32."""
    edges: np.ndarray
    """Corners of each edge in the order of the mid-side nodes, shape (m, 2), int32."""

    def triangles(self, corners: np.ndarray) -> np.ndarray:
        """Return triangles (f, 3) with their mid-side nodes, shape (f, 6), int32."""
        base = len(self.nodes) - len(self.edges)
        number = {tuple(edge): base + k for k, edge in enumerate(self.edges.tolist())}
        middle = [[number[tuple(sorted((t[a], t[b])))] for a, b in elements.FACE_EDGES] for t in corners.tolist()]
        return np.concatenate([corners, np.array(middle, dtype=int).reshape(-1, 3)], axis=1).astype(np.int32)


def with_middles(vertices: np.ndarray, tets: np.ndarray) -> Quadratic:
    """Return tetrahedra (e, 4) with mid-side nodes added."""
    edges, inverse = np.unique(np.sort(tets[:, elements.EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    nodes = np.concatenate([vertices, vertices[edges].mean(axis=1)])  # ty: ignore[invalid-argument-type]
    tet10 = np.concatenate([tets, len(vertices) + inverse.reshape(-1, 6)], axis=1).astype(np.int32)
    return Quadratic(nodes, tet10, edges)
