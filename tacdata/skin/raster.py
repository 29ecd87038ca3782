"""From displacements of the outer face to the depth map: the height of the deformed face above each pixel centre.

Point-sampled at pixel centres. The material point above a pixel, X + u(X) = x, is found on the quadratic surface,
so the map is exact to the surface triangles.
"""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.skin import elements
from tacdata.skin.mesh import SkinMesh

_ITERATIONS = 100
"""Searches for the material point above a pixel before its face counts as folded."""

_CUTS = 8
"""Parts into which a triangle's edge is cut where the face is folded."""


class OuterFace:
    """Point location and interpolation on the undeformed outer face, which is a graph over (x, y)."""

    def __init__(self, mesh: SkinMesh) -> None:
        """Sort the triangles of the outer face into a grid of cells."""
        self._nodes, self._faces = mesh.nodes, mesh.outer
        corners = mesh.nodes[mesh.outer[:, :3], :2]
        self._origin = corners[:, 0]
        self._inverse = np.linalg.inv(np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1))
        self._low, self._high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self._cell = 2.0 * float(np.sqrt(np.prod(self._high - self._low) / len(corners)))
        self._count = np.ceil((self._high - self._low) / self._cell).astype(int)
        bins: list[list[int]] = [[] for _ in range(int(np.prod(self._count)))]
        first = np.clip(((corners.min(axis=1) - self._low) / self._cell).astype(int), 0, self._count - 1)
        last = np.clip(((corners.max(axis=1) - self._low) / self._cell).astype(int), 0, self._count - 1)
        for triangle, (a, b) in enumerate(zip(first, last, strict=True)):
            for i in range(a[0], b[0] + 1):
                for j in range(a[1], b[1] + 1):
                    bins[i * self._count[1] + j].append(triangle)
        width = max(len(b) for b in bins)
        self._bins = np.array([b + b[-1:] * (width - len(b)) if b else [0] * width for b in bins])

    def locate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangle, shape (n,), and its (xi, eta), shape (n, 2), under points [mm], shape (n, 2).

        Points off the face get the nearest place on it.
        """
        inside = np.clip(points, self._low, self._high)
        cell = np.clip(((inside - self._low) / self._cell).astype(int), 0, self._count - 1)
        candidates = self._bins[cell[:, 0] * self._count[1] + cell[:, 1]]
        local = np.einsum("ncij,ncj->nci", self._inverse[candidates], inside[:, None] - self._origin[candidates])
        worst = np.minimum(np.minimum(local[..., 0], local[..., 1]), 1 - local.sum(axis=-1))
        best = worst.argmax(axis=1)
        row = np.arange(len(points))
        return candidates[row, best], local[row, best]

    def displacement(self, points: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the displacement [mm], shape (n, 3), of the material points above (x, y) [mm], shape (n, 2).

        Args:
            points: Undeformed places.
            u: Nodal displacements [mm], shape (nodes, 3).
        """
        triangle, local = self.locate(points)
        return np.einsum("na,nai->ni", elements.triangle_shapes(local), u[self._faces[triangle]])

    def depth_map(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return undeformed minus deformed height [mm] at pixel centres, shape (len(x), len(y)).

        Where an indenter's steep flank folds the face over itself, the uppermost sheet counts.

        Raises:
            SolveError: If no part of the deformed face lies above a pixel.
        """
        pixels = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        material = pixels.copy()
        shift = np.zeros((len(pixels), 3))
        open_ = np.arange(len(pixels))
        for _ in range(_ITERATIONS):
            shift[open_] = self.displacement(material[open_], u)
            error = pixels[open_] - shift[open_, :2] - material[open_]
            open_, error = open_[(off := np.abs(error).max(axis=1) > 1e-7)], error[off]
            if not len(open_):
                break
            material[open_] += error
        depth = -shift[:, 2]
        if len(open_):
            depth[open_] = self._uppermost(pixels[open_], u)
        return depth.reshape(len(x), len(y))

    def _uppermost(self, pixels: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the depth [mm] of the uppermost sheet above pixels (n, 2), triangles cut into flat sixty-fourths."""
        steps = np.arange(_CUTS + 1) / _CUTS
        grid = np.array([(a, b) for a in steps for b in steps if a + b < 1 + 1e-9])
        number = {(round(a * _CUTS), round(b * _CUTS)): k for k, (a, b) in enumerate(grid)}
        cells = []
        for i, j in number:
            if i + j < _CUTS:
                cells.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < _CUTS - 1:
                cells.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
        shapes = elements.triangle_shapes(grid)
        place = np.einsum("ka,fai->fki", shapes, (self._nodes + u)[self._faces])
        depth = np.einsum("ka,fa->fk", shapes, -u[self._faces][:, :, 2])
        corners = place[:, np.array(cells)].reshape(-1, 3, 3)
        depths = depth[:, np.array(cells)].reshape(-1, 3)
        edges = np.stack([corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]], axis=-1)
        keep = np.abs(np.linalg.det(edges)) > 1e-12
        corners, depths, inverse = corners[keep], depths[keep], np.linalg.inv(edges[keep])
        result = np.empty(len(pixels))
        for k, pixel in enumerate(pixels):
            local = np.einsum("tij,tj->ti", inverse, pixel - corners[:, 0, :2])
            b = np.concatenate([1 - local.sum(axis=1, keepdims=True), local], axis=1)
            over = np.flatnonzero(b.min(axis=1) > -1e-9)
            if not len(over):
                raise SolveError(
                    f"no part of the deformed face lies above pixel {pixel.round(2).tolist()} mm",
                    "a map inside the skin's footprint",
                    "check map and skin in the sensor file, or press less deep",
                )
            heights = (b[over] * corners[over, :, 2]).sum(axis=1)
            best = over[heights.argmax()]
            result[k] = (b[best] * depths[best]).sum()
        return result
