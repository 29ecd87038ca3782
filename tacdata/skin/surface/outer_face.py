"""From displacements of the outer face to the depth map, and point location on the undeformed outer face.

Maps are exact to the quadratic triangles of the outer face. Pixels are sampled at their centres or averaged. For many
states at once, or on a GPU, see `tacdata.skin.surface.depth_map`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.depth_map import DepthRaster
from tacdata.skin.surface.pressed_shape import PressedShape

_NEWTON = 20
"""Steps to a point on a triangle whose edges bend in plan; straight ones need none."""


class OuterFace:
    """The undeformed outer face, which is a graph over (x, y): point location, interpolation, depth maps."""

    def __init__(self, mesh: SkinMesh) -> None:
        """Sort the triangles of the outer face into a grid of cells."""
        self._mesh, self._faces = mesh, mesh.outer
        self._plan = mesh.nodes[mesh.outer][:, :, :2]
        corners = self._plan[:, :3]
        self._origin = corners[:, 0]
        self._inverse = np.linalg.inv(np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1))
        self._bent = bool(np.abs(self._plan[:, 3:] - _middles(corners)).max(initial=0.0) > 1e-9)
        self._low, self._high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        # Cells a few triangles wide: few candidates a point, few cells a triangle.
        self._cell = 2.0 * float(np.sqrt(np.prod(self._high - self._low) / len(corners)))
        self._count = np.ceil((self._high - self._low) / self._cell).astype(int)
        self._bins = self._sort(corners)
        self._rasters: dict[tuple[bytes, bytes, str], DepthRaster] = {}

    def _sort(self, corners: np.ndarray) -> np.ndarray:
        """Return the triangles near each cell, shape (cells, most), the last of a cell repeated."""
        bins: list[list[int]] = [[] for _ in range(int(np.prod(self._count)))]
        first = np.clip(((corners.min(axis=1) - self._low) / self._cell).astype(int), 0, self._count - 1)
        last = np.clip(((corners.max(axis=1) - self._low) / self._cell).astype(int), 0, self._count - 1)
        for triangle, (a, b) in enumerate(zip(first, last, strict=True)):
            for i in range(a[0], b[0] + 1):
                for j in range(a[1], b[1] + 1):
                    bins[i * self._count[1] + j].append(triangle)
        # Equal lengths, so that all points are located at once.
        width = max(len(b) for b in bins)
        return np.array([b + b[-1:] * (width - len(b)) if b else [0] * width for b in bins])

    def locate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangle, shape (n,), and its (xi, eta), shape (n, 2), under points [mm], shape (n, 2).

        Points off the face get a place on its rim, for a rectangular face the nearest.
        """
        inside = np.clip(points, self._low, self._high)
        cell = np.clip(((inside - self._low) / self._cell).astype(int), 0, self._count - 1)
        candidates = self._bins[cell[:, 0] * self._count[1] + cell[:, 1]]
        local = np.einsum("ncij,ncj->nci", self._inverse[candidates], inside[:, None] - self._origin[candidates])
        if self._bent:
            local = self._bend(candidates, local, inside)
        worst = np.minimum(np.minimum(local[..., 0], local[..., 1]), 1 - local.sum(axis=-1))
        # The largest of the smallest coordinates also decides on the rim, where rounding puts points outside of all.
        best = worst.argmax(axis=1)
        row = np.arange(len(points))
        return candidates[row, best], _inside(local[row, best])

    def _bend(self, triangles: np.ndarray, local: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Correct places (n, c, 2) on triangles (n, c) for edges that bend in plan, by Newton's method."""
        shape = local.shape
        local, plan = np.clip(local.reshape(-1, 2), -1.0, 2.0), self._plan[triangles.ravel()]
        target = np.repeat(points, shape[1], axis=0)
        for _ in range(_NEWTON):
            remainder = target - np.einsum("na,nai->ni", elements.triangle_shapes(local), plan)
            jacobian = np.einsum("nai,nak->nik", plan, elements.triangle_gradients(local))
            # Candidates that do not contain the point may degenerate or diverge; they are never chosen.
            regular = np.abs(np.linalg.det(jacobian)) > 1e-12
            step = np.zeros_like(local)
            step[regular] = np.linalg.solve(jacobian[regular], remainder[regular][..., None])[..., 0]
            local = np.clip(local + np.clip(step, -0.5, 0.5), -1.0, 2.0)
            if np.abs(step).max(initial=0.0) < 1e-13:
                break
        return local.reshape(shape)

    def displacement(self, points: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the displacement [mm], shape (n, 3), of the material points above (x, y) [mm], shape (n, 2).

        Args:
            points: Undeformed places.
            u: Nodal displacements [mm], shape (nodes, 3).
        """
        triangle, local = self.locate(points)
        return np.einsum("na,nai->ni", elements.triangle_shapes(local), u[self._faces[triangle]])

    def height(self, points: np.ndarray) -> np.ndarray:
        """Return the height of the undeformed face [mm], shape (n,), above (x, y) [mm], shape (n, 2)."""
        return self.displacement(points, self._mesh.nodes)[:, 2]

    def depth_map(self, x: np.ndarray, y: np.ndarray, u: np.ndarray, sampling: str = "point") -> np.ndarray:
        """Return undeformed minus deformed height [mm] of pixels, shape (len(x), len(y)): the mesh's own map.

        Where an indenter's steep flank folds the face over itself, the uppermost sheet counts. A pixel next to the
        skin, deformed or not, has depth 0.

        Args:
            x: Pixel centres along x [mm], ascending.
            y: Pixel centres along y [mm], ascending.
            u: Nodal displacements [mm], shape (nodes, 3).
            sampling: "point" (at pixel centres) or "area" (mean over the pixel's square).

        Raises:
            UsageError: If there is no such sampling, or pixels to average over are not evenly spaced.
        """
        return self._raster(x, y, sampling).depth(_columns([u]))[0].numpy()

    def pressed_maps(
        self, x: np.ndarray, y: np.ndarray, u: Sequence[np.ndarray], sampling: str, shapes: Sequence[PressedShape]
    ) -> np.ndarray:
        """Return depth maps [mm] of states, shape (b, len(x), len(y)); where the face touches, those of the shape.

        Args:
            x: Pixel centres along x [mm], ascending.
            y: Pixel centres along y [mm], ascending.
            u: Nodal displacements [mm] of each state, (b,) of shape (nodes, 3).
            sampling: As of `depth_map`.
            shapes: The indenter in each state, (b,).

        Raises:
            UsageError: As of `depth_map`.
        """
        if not len(u):
            return np.empty((0, len(x), len(y)))
        return self._raster(x, y, sampling).pressed(_columns(u), shapes).numpy()

    def _raster(self, x: np.ndarray, y: np.ndarray, sampling: str) -> DepthRaster:
        key = (np.asarray(x, dtype=float).tobytes(), np.asarray(y, dtype=float).tobytes(), sampling)
        if key not in self._rasters:
            self._rasters[key] = DepthRaster(self._mesh, x, y, sampling)
        return self._rasters[key]


def _columns(u: Sequence[np.ndarray]) -> torch.Tensor:
    """Return displacements (nodes, 3) of b states side by side, shape (nodes, 3, b)."""
    return torch.as_tensor(np.stack([np.asarray(state) for state in u], axis=-1))


def _middles(corners: np.ndarray) -> np.ndarray:
    return np.stack([(corners[:, a] + corners[:, b]) / 2 for a, b in elements.FACE_EDGES], axis=1)


def _inside(local: np.ndarray) -> np.ndarray:
    """Return places (n, 2) moved into the triangle."""
    local = np.maximum(local, 0.0)
    return local / np.maximum(local.sum(axis=1, keepdims=True), 1.0)
