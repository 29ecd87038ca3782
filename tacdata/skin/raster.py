"""From displacements of the outer face to the depth map: the height of the deformed face above each pixel centre.

Point-sampled at pixel centres. The material point above a pixel, X + u(X) = x, is found on the quadratic surface itself,
so the map is exact to the surface triangles.
"""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.skin import elements
from tacdata.skin.mesh import SkinMesh


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

        Raises:
            SolveError: If the deformed face is folded above a pixel.
        """
        pixels = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        material = pixels.copy()
        shift = np.zeros((len(pixels), 3))
        miss = np.inf
        for _ in range(200):
            shift = self.displacement(material, u)
            error = pixels - shift[:, :2] - material
            miss = float(np.abs(error).max())
            if miss < 1e-7:
                break
            material += error
        else:
            worst = pixels[int(np.abs(pixels - shift[:, :2] - material).max(axis=1).argmax())]
            raise SolveError(
                f"no single point of the deformed face lies above pixel {worst.round(2).tolist()} mm (off by {miss:.1e} mm)",
                "a deformed outer face without folds", "press less deep or choose a blunter indenter",
            )
        return -shift[:, 2].reshape(len(x), len(y))
