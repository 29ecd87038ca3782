"""The Cholesky factor of a sparse matrix in single precision, by the fastest library that is installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.skin.linear import constraint_kernels as kernels
from tacdata.skin.linear.pardiso import PardisoFactor, runtime
from tacdata.skin.member.warp_arrays import argument, filled
from tacdata.warp_runtime import wp

Forces = Callable[[torch.Tensor], torch.Tensor]
"""Forces on mortar rows [N] by what they move [mm], both of shape (m, b), float32."""


class Factor(Protocol):
    """A^-1 of a symmetric positive definite A, shape (n, n)."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return A^-1 b; shapes (n, b), float32."""
        ...


class CholmodFactor:
    """CHOLMOD's factor with the triangular solves of cholespy; on every platform."""

    def __init__(self, matrix: sp.csr_matrix) -> None:
        """Factorize a symmetric matrix, all its entries stored."""
        # A compiled module without type stubs.
        from cholespy import CholeskySolverF, MatrixType  # ty: ignore[missing-module-member]

        rows = sp.csr_matrix(matrix).sorted_indices()
        starts, columns = rows.indptr.astype(np.int32), rows.indices.astype(np.int32)
        self._solver = CholeskySolverF(len(starts) - 1, starts, columns, rows.data.astype(np.float64), MatrixType.CSR)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return A^-1 b; shapes (n, b), float32."""
        rhs = np.ascontiguousarray(rhs, dtype=np.float32)
        solution = np.empty_like(rhs)
        if rhs.shape[1] == 1:
            self._solver.solve(rhs.reshape(-1), solution.reshape(-1))
        else:
            self._solver.solve(rhs, solution)
        return solution


def factor_of(matrix: sp.csr_matrix) -> Factor:
    """Factorize a symmetric positive definite matrix, all its entries stored; shape (n, n).

    By MKL's PARDISO where it is installed (Linux on x86-64), else by CHOLMOD, at several times the time.

    Raises:
        SolveError: If PARDISO finds that it is not positive definite.
    """
    library = runtime()
    return CholmodFactor(matrix) if library is None else PardisoFactor(matrix, library)


class HalfRows:
    """L^-1 M^T of mortar rows, for K0 = L L^T: constraints are held within one solve.

        K0^-1 (r - M^T f(M K0^-1 r)) = L^-T (w - G f(G^T w)),   w = L^-1 r,   G = L^-1 M^T

    A row is sparse: 1,800 of 28,600 entries on the default mesh.
    """

    def __init__(self, factor: PardisoFactor) -> None:
        """Start without rows."""
        self._factor, self._count = factor, 0
        self._column, self._value = torch.zeros(0, dtype=torch.int32), torch.zeros(0)
        self._start, self._row = torch.zeros(1, dtype=torch.int32), torch.zeros(0, dtype=torch.int32)

    def add(self, rows: torch.Tensor, loads: torch.Tensor) -> torch.Tensor:
        """Add rows of M, by number, shape (p,), and as columns, shape (n, p).

        Returns:
            M K0^-1 M^T = G^T G of all k rows so far with these [mm/N], shape (k, p).
        """
        # A row of M has few entries, and so has its forward substitution: it is kept sparse, and a later product costs
        # half a solve.
        half = self._factor.forward(loads.numpy()).T
        first, column = half.nonzero()
        end, value = self._count + len(column), half[first, column]
        if end > len(self._column):
            # Twice the room, so that few entries are copied again.
            grown = torch.zeros(end, dtype=torch.int32), torch.zeros(end)
            self._column, self._value = torch.cat([self._column, grown[0]]), torch.cat([self._value, grown[1]])
        self._column[self._count : end] = torch.from_numpy(column)
        self._value[self._count : end] = torch.from_numpy(value)
        ends = self._count + np.cumsum(np.bincount(first, minlength=len(rows)))
        self._start = torch.cat([self._start, torch.from_numpy(ends.astype(np.int32))])
        self._row, self._count = torch.cat([self._row, rows.to(torch.int32)]), end
        known = self._value[:end].numpy(), self._column[:end].numpy(), self._start.numpy()
        # A sparse product costs a quarter of the back substitution that it stands for.
        return torch.from_numpy(sp.csr_matrix(known, shape=(len(self._row), half.shape[1])) @ half.T.copy())

    def held(self, residual: torch.Tensor, used: torch.Tensor, forces: Forces) -> torch.Tensor:
        """Return K0^-1 (r - M^T f); arguments as of `rest_stiffness.RestSolver.held`, of free degrees of freedom."""
        half = torch.from_numpy(self._factor.forward(residual.numpy()).T)
        moved, known = torch.zeros(used.shape), len(self._row)
        rows = filled(kernels.SparseRows, start=self._start, column=self._column, value=self._value, row=self._row)
        self._launch(kernels.along_rows, (known, len(half)), rows, used, half, moved)
        self._launch(kernels.less_rows, (len(half),), rows, used, forces(moved), half)
        return torch.from_numpy(self._factor.backward(half.numpy().T))

    def _launch(self, kernel: Any, dim: tuple[int, ...], *values: object) -> None:
        wp.launch(kernel, dim=dim, inputs=[*map(argument, values)], device="cpu")
