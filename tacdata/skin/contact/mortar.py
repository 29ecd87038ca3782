"""Weighted means over the hats of contact nodes, and the forces that do the same work: a mortar projection.

A hat is the piecewise linear function of one node on the four sub-triangles of each quadratic face. Row j holds
M_ja = sum w psi_j N_a / sum w psi_j, so that M u is the mean displacement under the hat. Its transpose spreads a force
per hat over the nodes. Rows never change.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.skin.member.warp_arrays import REAL, argument
from tacdata.warp_runtime import wp


@cache
def product_kernel(real: type) -> wp.Kernel:
    """Compile the kernel that multiplies with a sparse matrix, in one precision."""

    @wp.kernel(module="unique", enable_backward=False)
    def product(
        start: wp.array(dtype=wp.int32),
        column: wp.array(dtype=wp.int32),
        value: wp.array(dtype=real),
        row: wp.array(dtype=wp.int32),
        field: wp.array3d(dtype=real),
        result: wp.array3d(dtype=real),
    ):
        """Add the matrix times a field: one row and member a thread, so that sums have a fixed order."""
        j, b = wp.tid()
        x, y, z = real(0.0), real(0.0), real(0.0)
        for k in range(start[j], start[j + 1]):
            x += value[k] * field[column[k], 0, b]
            y += value[k] * field[column[k], 1, b]
            z += value[k] * field[column[k], 2, b]
        r = row[j]
        result[r, 0, b] = result[r, 0, b] + x
        result[r, 1, b] = result[r, 1, b] + y
        result[r, 2, b] = result[r, 2, b] + z

    return product


class _Rows:
    """A sparse matrix for the kernel; ``row`` is the index at which each of its rows is added."""

    def __init__(self, matrix: sp.csr_matrix, row: np.ndarray, device: str) -> None:
        self._device, self._count = device, len(row)
        self._where = tuple(
            torch.as_tensor(values.astype(np.int32), device=device) for values in (matrix.indptr, matrix.indices, row)
        )
        self._value = {real: torch.as_tensor(matrix.data, device=device).to(real) for real in REAL}

    def add(self, field: torch.Tensor, result: torch.Tensor) -> None:
        start, column, row = self._where
        wp.launch(
            product_kernel(REAL[field.dtype]),
            dim=(self._count, field.shape[2]),
            inputs=[argument(value) for value in (start, column, self._value[field.dtype], row, field)],
            outputs=[argument(result)],
            device=self._device,
        )


class Mortar:
    """The projection of one contact's faces; s contact nodes."""

    def __init__(
        self, faces: np.ndarray, weights: np.ndarray, shapes: np.ndarray, hats: np.ndarray, nodes: int, device: str
    ) -> None:
        """Integrate.

        Args:
            faces: Quadratic triangles, shape (f, 6).
            weights: Area weights [mm^2], shape (f, k).
            shapes: Shape functions at the points [1], shape (k, 6).
            hats: Hats at the points [1], shape (k, 6).
            nodes: Nodes of the mesh.
            device: "cpu" or "cuda:0".
        """
        self.nodes, slots = np.unique(faces, return_inverse=True)
        """Contact nodes among those of the mesh, shape (s,)."""
        self.slots = slots.reshape(faces.shape)
        """Contact node of each face's node, shape (f, 6)."""
        local = np.einsum("fk,kj,ka->fja", weights, hats, shapes)
        rows, columns = np.repeat(self.slots, 6, axis=1).ravel(), np.tile(faces, (1, 6)).ravel()
        matrix = sp.csr_matrix(sp.coo_matrix((local.ravel(), (rows, columns)), shape=(len(self.nodes), nodes)))
        self.area = np.asarray(matrix.sum(axis=1), dtype=np.float64).ravel()
        """Area of each hat, undeformed [mm^2], shape (s,)."""
        # Means, not values at nodes: a gap at a mid-side node alone would let corners pass into the shape.
        self.mean = sp.csr_matrix(sp.diags_array(1 / self.area) @ matrix)
        """Mean over each hat of a field on the mesh's nodes [1], shape (s, n)."""
        # The transpose spreads forces so that their work equals that of the means: the tangent stays symmetric without
        # friction.
        back = sp.csr_matrix(self.mean.T)[self.nodes]
        self._down = _Rows(self.mean, np.arange(len(self.nodes)), device)
        self._up = _Rows(back, self.nodes, device)

    def means(self, field: torch.Tensor) -> torch.Tensor:
        """Return the mean of a field, shape (n, 3, b), over every hat, shape (s, 3, b)."""
        result = torch.zeros(len(self.nodes), 3, field.shape[2], dtype=field.dtype, device=field.device)
        self._down.add(field, result)
        return result

    def spread(self, forces: torch.Tensor, result: torch.Tensor) -> None:
        """Add forces per hat [N], shape (s, 3, b), to nodal forces, shape (n, 3, b)."""
        self._up.add(forces, result)
