"""Nearest points on a closed triangle surface, with sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.warp_runtime import ON_CPU, wp  # noqa: TID253 - kernels; imported when a surface is asked, never with a plan


@wp.kernel(module="unique", module_options=ON_CPU, enable_backward=False)
def _query(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    face: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.vec2),
    side: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    query = wp.mesh_query_point_sign_normal(mesh, points[i], 1.0e6)
    face[i] = query.face  # ty: ignore[missing-attribute]
    place[i] = wp.vec2(query.u, query.v)  # ty: ignore[missing-attribute]
    side[i] = wp.float64(query.sign)  # ty: ignore[missing-attribute]


@dataclass(frozen=True)
class NearestPoints:
    """Nearest points on the surface for some query points."""

    face: np.ndarray
    """Triangle, shape (n,), int32."""
    point: np.ndarray
    """Nearest point on it [mm], shape (n, 3)."""
    distance: np.ndarray
    """Distance from it [mm], negative inside, shape (n,)."""


class Nearest:
    """A closed surface with a search tree for nearest points."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Build the tree of triangles (f, 3) over vertices (v, 3) [mm]."""
        self._corners = vertices[faces]
        indices = wp.array(np.ascontiguousarray(faces, dtype=np.int32).ravel(), dtype=wp.int32, device="cpu")
        points = wp.array(vertices.astype(np.float32), dtype=wp.vec3, device="cpu")
        self._mesh = wp.Mesh(points=points, indices=indices)

    def places(self, points: np.ndarray) -> NearestPoints:
        """Return the nearest surface points of points [mm], shape (n, 3).

        The tree is searched in single precision; the point is then computed in double.
        """
        n = len(points)
        face, place = wp.zeros(n, dtype=wp.int32, device="cpu"), wp.zeros(n, dtype=wp.vec2, device="cpu")
        side = wp.zeros(n, dtype=wp.float64, device="cpu")
        queries = wp.array(points.astype(np.float32), dtype=wp.vec3, device="cpu")
        wp.launch(_query, n, inputs=[self._mesh.id, queries, face, place, side], device="cpu")
        which = face.numpy()
        nearest = _on_triangle(points, self._corners[which], place.numpy().astype(float))
        return NearestPoints(which, nearest, side.numpy() * np.linalg.norm(points - nearest, axis=1))


def _on_triangle(points: np.ndarray, corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the nearest point of each triangle (n, 3, 3) in double precision, from the weights of its first two
    corners.

    Inside the triangle that is the foot of the perpendicular; on an edge or a corner the given weights are kept.
    """
    u, v = np.clip(place, 0.0, 1.0).T
    weights = np.stack([u, v, np.clip(1 - u - v, 0.0, 1.0)], axis=-1)
    nearest = np.einsum("nk,nki->ni", weights, corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.maximum(size, 1e-300)
    within = (weights.min(axis=1) > 1e-5) & (size[:, 0] > 0)
    foot = points - np.einsum("ni,ni->n", points - corners[:, 0], normal)[:, None] * normal
    return np.where(within[:, None], foot, nearest)
