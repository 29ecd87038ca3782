"""The rest state's stiffness, factorized once: one preconditioner for every press on a mesh."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.sensor import Material
from tacdata.skin.mesh import SkinMesh


def rest_stiffness(mesh: SkinMesh, material: Material) -> sp.csr_matrix:
    """Assemble the linear-elastic stiffness [N/mm], shape (3n, 3n): every law's tangent at F = I."""
    mu = material.shear_modulus
    lam = material.bulk_modulus - 2 * mu / 3
    slopes, weights = mesh.shape_gradients()
    count = len(mesh.tets)
    blocks = np.zeros((count, 10, 3, 10, 3))
    for q in range(weights.shape[1]):
        g, w = slopes[:, q], weights[:, q]
        dots = np.einsum("eai,ebi,e->eab", g, g, mu * w)
        pairs = np.einsum("eai,ebj,e->eaibj", g, g, w, optimize=True)
        blocks += lam * pairs + mu * pairs.transpose(0, 1, 4, 3, 2)
        for i in range(3):
            blocks[:, :, i, :, i] += dots
    dofs = (3 * mesh.tets[:, :, None] + np.arange(3)).reshape(count, 30)
    rows = np.repeat(dofs, 30, axis=1).ravel()
    columns = np.tile(dofs, (1, 30)).ravel()
    size = 3 * len(mesh.nodes)
    return sp.csr_matrix(sp.coo_matrix((blocks.ravel(), (rows, columns)), shape=(size, size)))


class RestFactor:
    """Sparse Cholesky factor of the rest stiffness on the free degrees of freedom (CHOLMOD through cholespy).

    Kept in single precision: a preconditioner needs no more, and its two triangular solves are bound by memory.
    """

    def __init__(self, stiffness: sp.csr_matrix, free: np.ndarray) -> None:
        """Factorize. ``free``: indices of the degrees of freedom that are not held."""
        # A compiled module without type stubs.
        from cholespy import CholeskySolverF, MatrixType  # pyright: ignore[reportAttributeAccessIssue]

        self.free = torch.as_tensor(free)
        reduced = stiffness[free][:, free].tocsc()
        reduced.sort_indices()
        self._solver = CholeskySolverF(
            reduced.shape[0], reduced.indptr.astype(np.int32), reduced.indices.astype(np.int32),
            reduced.data.astype(np.float64), MatrixType.CSC,
        )

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (b, n, 3)."""
        batch = residual.shape[0]
        rhs = residual.reshape(batch, -1)[:, self.free]
        size = rhs.abs().amax().clamp_min(1e-30)
        columns = np.ascontiguousarray((rhs / size).numpy().T, dtype=np.float32)
        solution = np.empty_like(columns)
        if batch == 1:
            self._solver.solve(columns[:, 0].copy(), solution.reshape(-1))
        else:
            self._solver.solve(columns, solution)
        result = torch.zeros(batch, residual[0].numel(), dtype=torch.float64)
        result[:, self.free] = torch.from_numpy(solution.T.astype(np.float64)) * size
        return result.reshape(residual.shape)
