"""PARDISO of Intel's MKL: a supernodal Cholesky factor in single precision.

Schenk and Gaertner, Future Gener. Comput. Syst. 20 (2004) 475; the call and iparm as in the oneMKL reference, "Intel
oneMKL PARDISO - Parallel Direct Sparse Solver Interface". Through ctypes: bindings on PyPI have double precision alone.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np
import scipy.sparse as sp

from tacdata.errors import SolveError

_SEQUENTIAL, _INT32 = 1, 0
"""MKL's layers without threads, as a worker has one core, and with integers of 32 bits."""
_POSITIVE_DEFINITE = 2
"""Kind of matrix: real, symmetric, positive definite; its upper triangle is given."""
_FACTORIZE, _SOLVE, _RELEASE = 12, 33, -1
_FORWARD, _BACKWARD = 331, 333
"""The two halves of a solve."""
_PARAMETERS = {0: 1, 1: 2, 27: 1, 34: 1}
"""Numbers of iparm from 0: no defaults, nested dissection, single precision, indices from 0. The rest is 0."""


@cache
def runtime() -> Any | None:
    """Return MKL's runtime library, None where it is not installed."""
    try:
        [path] = [str(file.locate()) for file in files("mkl") or () if file.name.startswith("libmkl_rt.so")]
        library = ctypes.CDLL(path)
    except (PackageNotFoundError, OSError, ValueError):
        # ValueError: the package contains no such library, or more than one.
        return None
    library.MKL_Set_Interface_Layer(_INT32)
    # One thread: the farm runs one worker a core, and torch brings its own OpenMP.
    library.MKL_Set_Threading_Layer(_SEQUENTIAL)
    return library


class PardisoFactor:
    """A^-1 of a symmetric positive definite A."""

    def __init__(self, matrix: sp.csr_matrix, library: Any) -> None:
        """Factorize.

        Args:
            matrix: Symmetric, all its entries stored.
            library: Result of `runtime`.

        Raises:
            SolveError: If it is not positive definite.
        """
        upper = sp.csr_matrix(sp.triu(matrix)).sorted_indices()
        self._values = upper.data.astype(np.float32)
        self._starts, self._columns = upper.indptr.astype(np.int32), upper.indices.astype(np.int32)
        self._memory = _Memory(library, len(self._starts) - 1)
        # A finalizer must hold no reference to its object.
        weakref.finalize(self, self._memory.call, _RELEASE, (None, None, None))
        code = self._call(_FACTORIZE)
        if code:
            raise SolveError(
                f"a stiffness of {self._memory.size} degrees of freedom that PARDISO cannot factorize (error {code})",
                "a positive definite one",
                "hold some part of the skin (bonding), and check the mesh and the material",
            )

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return A^-1 b; shapes (n, b), float32.

        Raises:
            SolveError: If memory does not hold so many.
        """
        return self._solved(_SOLVE, rhs)

    def forward(self, rhs: np.ndarray) -> np.ndarray:
        """Return L^-1 b, of A = L L^T in an order of PARDISO's own; as `solve`."""
        return self._solved(_FORWARD, rhs)

    def backward(self, rhs: np.ndarray) -> np.ndarray:
        """Return L^-T b; as `solve`."""
        return self._solved(_BACKWARD, rhs)

    def _solved(self, phase: int, rhs: np.ndarray) -> np.ndarray:
        # PARDISO reads right-hand sides one after another in memory.
        columns = np.ascontiguousarray(rhs.T, dtype=np.float32)
        solution = np.empty_like(columns)
        code = self._call(phase, columns, solution)
        if code:
            raise SolveError(
                f"{len(columns)} right-hand sides of {self._memory.size} that PARDISO cannot solve (error {code})",
                "as many as memory holds",
                "solve fewer presses at once",
            )
        return solution.T

    def _call(self, phase: int, rhs: np.ndarray | None = None, solution: np.ndarray | None = None) -> int:
        return self._memory.call(phase, (self._values, self._starts, self._columns), rhs, solution)


class _Memory:
    """The library's data of one factor."""

    def __init__(self, library: Any, size: int) -> None:
        self.size = size
        self._library = library
        # MKL requires a handle of 64 zeros at the first call.
        self._handle = np.zeros(64, dtype=np.int64)
        self._parameters = np.zeros(64, dtype=np.int32)
        self._parameters[list(_PARAMETERS)] = list(_PARAMETERS.values())

    def call(
        self,
        phase: int,
        matrix: tuple[np.ndarray | None, ...],
        rhs: np.ndarray | None = None,
        solution: np.ndarray | None = None,
    ) -> int:
        """Return the library's error code, 0 for none; ``rhs`` and ``solution`` of shape (b, n)."""
        error = ctypes.c_int(0)
        values, starts, columns = map(_at, matrix)
        # In MKL's order: pt, maxfct, mnum, mtype, phase, n, a, ia, ja, perm, nrhs, iparm, msglvl, b, x, error.
        self._library.pardiso(
            _at(self._handle),
            _number(1),
            _number(1),
            _number(_POSITIVE_DEFINITE),
            _number(phase),
            _number(self.size),
            values,
            starts,
            columns,
            None,
            _number(1 if rhs is None else len(rhs)),
            _at(self._parameters),
            _number(0),
            _at(rhs),
            _at(solution),
            ctypes.byref(error),
        )
        return error.value


def _number(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


def _at(array: np.ndarray | None) -> ctypes.c_void_p | None:
    return None if array is None else array.ctypes.data_as(ctypes.c_void_p)
