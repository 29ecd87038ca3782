"""The Cholesky factor of a sparse matrix in single precision, by the fastest library that is installed."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sp

from tacdata.skin.linear.pardiso import PardisoFactor, runtime


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
