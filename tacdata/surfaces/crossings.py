"""Finds triangles of a surface that intersect each other."""

from __future__ import annotations

import numpy as np

from tacdata.warp_runtime import ON_CPU, wp  # noqa: TID253 - kernels; imported when a surface is asked, never with a plan


@wp.func
def _pierces(p: wp.vec3d, q: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """True if the segment p-q passes through the triangle a, b, c, its edges included."""
    n = wp.cross(b - a, c - a)
    size = wp.length(n)
    if size <= wp.float64(0.0):
        return False
    n = n / size
    d0, d1 = wp.dot(p - a, n), wp.dot(q - a, n)
    # A tolerance of rounding: vertices that lie on the plane do not pierce it.
    slack = wp.float64(1.0e-9) * (wp.length(b - a) + wp.length(c - a) + wp.length(q - p))
    if wp.min(wp.abs(d0), wp.abs(d1)) <= slack or d0 * d1 > wp.float64(0.0):
        return False
    x = p + (d0 / (d0 - d1)) * (q - p)
    u = wp.dot(wp.cross(b - a, x - a), n) / size
    v = wp.dot(wp.cross(c - b, x - b), n) / size
    w = wp.dot(wp.cross(a - c, x - c), n) / size
    return wp.min(wp.min(u, v), w) > wp.float64(-1.0e-9)


@wp.kernel(module="unique", module_options=ON_CPU, enable_backward=False)
def _cross(
    mesh: wp.uint64,
    vertices: wp.array(dtype=wp.vec3d),
    faces: wp.array2d(dtype=wp.int32),
    partner: wp.array(dtype=wp.int32),
):
    f = wp.tid()
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    a, b, c = vertices[i], vertices[j], vertices[k]
    low, high = wp.min(wp.min(a, b), c), wp.max(wp.max(a, b), c)
    margin = wp.float64(1.0e-6) * wp.length(high - low)
    query = wp.mesh_query_aabb(
        mesh,
        wp.vec3(wp.float32(low[0] - margin), wp.float32(low[1] - margin), wp.float32(low[2] - margin)),
        wp.vec3(wp.float32(high[0] + margin), wp.float32(high[1] + margin), wp.float32(high[2] + margin)),
    )
    other = wp.int32(0)
    while wp.mesh_query_aabb_next(query, other):
        r, s, t = faces[other, 0], faces[other, 1], faces[other, 2]
        shared = i == r or i == s or i == t or j == r or j == s or j == t or k == r or k == s or k == t
        if not shared:
            d, e, g = vertices[r], vertices[s], vertices[t]
            if _pierces(a, b, d, e, g) or _pierces(b, c, d, e, g) or _pierces(c, a, d, e, g):
                partner[f] = other


def crossing_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return pairs of triangles of which the first has an edge through the second, shape (n, 2).

    Triangles that share a vertex are not looked at.

    Args:
        vertices: Positions [mm], shape (v, 3).
        faces: Triangles, shape (f, 3).
    """
    indices = np.ascontiguousarray(faces, dtype=np.int32)
    mesh = wp.Mesh(
        points=wp.array(vertices.astype(np.float32), dtype=wp.vec3, device="cpu"),
        indices=wp.array(indices.ravel(), dtype=wp.int32, device="cpu"),
    )
    partner = wp.full(len(faces), -1, dtype=wp.int32, device="cpu")
    exact = wp.array(vertices, dtype=wp.vec3d, device="cpu")
    wp.launch(
        _cross,
        len(faces),
        inputs=[mesh.id, exact, wp.array(indices, dtype=wp.int32, device="cpu"), partner],
        device="cpu",
    )
    partners = partner.numpy()
    first = np.flatnonzero(partners >= 0)
    return np.stack([first, partners[first]], axis=-1)
