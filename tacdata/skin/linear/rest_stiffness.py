"""The rest state's stiffness, prepared once: the preconditioner of every press on a mesh."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.errors import SolveError
from tacdata.sensor import Material
from tacdata.skin.elasticity.averaged_volume import averaged_stiffness
from tacdata.skin.linear.cholesky import Forces, HalfRows, factor_of
from tacdata.skin.linear.pardiso import PardisoFactor
from tacdata.skin.mesh.skin_mesh import SkinMesh


def rest_stiffness(mesh: SkinMesh, material: Material, averaged: bool = False) -> sp.csr_matrix:
    """Assemble the linear-elastic stiffness [N/mm], shape (3n, 3n): every law's tangent at F = I.

    With ``averaged`` volume changes (`tacdata.skin.elasticity.averaged_volume`) it is near it, as the average is
    lumped.
    """
    mu = material.shear_modulus
    # With averages, kappa enters by `averaged_stiffness` below.
    lam = (0.0 if averaged else material.bulk_modulus) - 2 * mu / 3
    slopes, weights = mesh.shape_gradients()
    count, nodes = len(mesh.tets), len(mesh.nodes)
    scaled = (slopes * np.sqrt(weights)[:, :, None, None]).reshape(count, -1, 30)
    pairs = (scaled.transpose(0, 2, 1) @ scaled).reshape(count, 10, 3, 10, 3)
    dots = np.einsum("eaibi->eab", pairs)
    blocks = lam * pairs + mu * pairs.transpose(0, 1, 4, 3, 2) + mu * np.einsum("eab,ij->eaibj", dots, np.eye(3))
    # Whole 3 x 3 blocks are added up: a ninth of the entries to sort.
    first, second = np.repeat(mesh.tets, 10, axis=1).ravel(), np.tile(mesh.tets, (1, 10)).ravel()
    pair, place = np.unique(first.astype(np.int64) * nodes + second, return_inverse=True)
    sums = sp.csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))))
    values = (sums @ blocks.transpose(0, 1, 3, 2, 4).reshape(-1, 9)).reshape(-1, 3, 3)
    starts = np.searchsorted(pair, np.arange(nodes + 1) * nodes)
    stiffness = sp.csr_matrix(sp.bsr_matrix((values, pair % nodes, starts), shape=(3 * nodes, 3 * nodes)))
    return stiffness + averaged_stiffness(mesh, material.bulk_modulus) if averaged else stiffness


def for_averaged(material: Material) -> Material:
    """Return a material whose K0, volumes at the points, precondition volume changes that are averaged.

    Averages resist smooth changes of volume by kappa, and rough ones hardly more than by mu. In a K0 that knows of no
    averages both have one stiffness: half-way between, sqrt(kappa mu), conjugate gradients need the fewest iterations.
    """
    mu = material.shear_modulus
    kappa = math.sqrt(material.bulk_modulus * mu)
    nu = (3 * kappa - 2 * mu) / (6 * kappa + 2 * mu)
    return replace(material, youngs_modulus=2 * mu * (1 + nu), poisson_ratio=nu)


class RestSolver(Protocol):
    """K0^-1 on one device, and the compliance of the rows of M, the mortar projections of all contacts."""

    device: str
    """"cpu" or "cuda:0"."""

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (3n, b), float32."""
        ...

    def rows(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return M z, shape (m, b), of z, shape (3n, b), float32."""
        ...

    def spread(self, forces: torch.Tensor) -> torch.Tensor:
        """Return M^T f, shape (3n, b), of f, shape (m, b), float32."""
        ...

    def table(self, used: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 M^T [mm/N], shape (m, m), float32, symmetric: known at least between ``used`` rows.

        Args:
            used: Which are needed, shape (m,), bool.
        """
        ...

    def held(self, residual: torch.Tensor, used: torch.Tensor, forces: Forces) -> torch.Tensor:
        """Return K0^-1 (r - M^T f) of forces f that depend on M K0^-1 r; shapes as of `apply`.

        Args:
            residual: r.
            used: Rows on which f depends and acts, shape (m, b), bool; known to the table.
            forces: f, shape (m, b), of M K0^-1 r, likewise.
        """
        ...


def _held(solver: RestSolver, residual: torch.Tensor, forces: Forces) -> torch.Tensor:
    return solver.apply(residual - solver.spread(forces(solver.rows(solver.apply(residual)))))


def rest_solver(
    mesh: SkinMesh, material: Material, fixed: np.ndarray, rows: sp.csr_matrix, device: str, averaged: bool = False
) -> RestSolver:
    """Prepare K0^-1: a sparse factor on the CPU, the dense inverse on a GPU.

    Args:
        mesh: The skin.
        material: Its elastic constants.
        fixed: Which nodes are held, shape (n,), bool.
        rows: M, shape (m, 3n).
        device: "cpu" or "cuda:0".
        averaged: Whether the body's volume changes are averaged at the corners.

    Raises:
        SolveError: If the inverse does not fit into the GPU's memory.
    """
    # A K0 with averages costs a sparse factor several times the fill, and saves no iterations (decision 0016).
    averaged_on_gpu = averaged and device != "cpu"
    stiffness = rest_stiffness(
        mesh, material if averaged_on_gpu == averaged else for_averaged(material), averaged_on_gpu
    )
    unfixed = np.flatnonzero(~np.repeat(fixed, 3))
    return (SparseRest if device == "cpu" else DenseRest)(stiffness, unfixed, rows, device)


class _MortarRows:
    """M and its transpose."""

    def __init__(self, rows: sp.csr_matrix, device: str) -> None:
        self.count = rows.shape[0]
        self.down, self.up = (compressed_rows(matrix, device) for matrix in (rows, sp.csr_matrix(rows.T)))


def compressed_rows(matrix: sp.csr_matrix, device: str) -> torch.Tensor:
    """Return a matrix as a sparse tensor on a device, float32: for products alone."""
    starts, columns = (torch.as_tensor(values.astype(np.int64)) for values in (matrix.indptr, matrix.indices))
    values = torch.as_tensor(matrix.data.astype(np.float32))
    with warnings.catch_warnings():
        # PyTorch calls compressed rows a beta, and warns that it trusts them; their products are all that is used.
        warnings.simplefilter("ignore", UserWarning)
        tensor = torch.sparse_csr_tensor(starts, columns, values, size=matrix.shape)
    return tensor.to(device)


class SparseRest:
    """Sparse Cholesky factor of the rest stiffness on the free degrees of freedom.

    Kept in single precision: a preconditioner needs no more, and its two triangular solves are bound by memory.
    """

    _BLOCK = 64

    def __init__(self, stiffness: sp.csr_matrix, unfixed: np.ndarray, rows: sp.csr_matrix, device: str = "cpu") -> None:
        """Factorize; arguments as of `rest_solver`, ``unfixed`` the degrees of freedom that are not held."""
        self.device = device
        self._free, self._mortar = torch.as_tensor(unfixed), _MortarRows(rows, device)
        self._factor = factor_of(stiffness[unfixed][:, unfixed])
        self.forget()

    def forget(self) -> None:
        """Forget the table of `table`."""
        # Rows are filled when a press first needs them and serve every later one; memory is taken as they are.
        count = self._mortar.count
        self._table = torch.from_numpy(np.empty((count, count), dtype=np.float32))
        self._known, self._order = torch.zeros(count, dtype=torch.bool), torch.zeros(0, dtype=torch.int64)
        self._halves = HalfRows(self._factor) if isinstance(self._factor, PardisoFactor) else None

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (3n, b), float32."""
        result = torch.zeros(residual.shape, dtype=torch.float32)
        result[self._free] = torch.from_numpy(self._factor.solve(residual[self._free].numpy()))
        return result

    def rows(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return M z, as `RestSolver`."""
        return self._mortar.down @ displacement

    def spread(self, forces: torch.Tensor) -> torch.Tensor:
        """Return M^T f, as `RestSolver`."""
        return self._mortar.up @ forces

    def table(self, used: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 M^T [mm/N], as `RestSolver`."""
        missing = (used & ~self._known).nonzero()[:, 0]
        for start in range(0, len(missing), self._BLOCK):
            part = missing[start : start + self._BLOCK]
            self._known[part] = True
            self._order = torch.cat([self._order, part])
            columns = self._columns(part)
            # Both halves from one solve: symmetric. Rows that no press has used keep their memory untouched.
            self._table[self._order[:, None], part], self._table[part[:, None], self._order] = columns, columns.T
        return self._table

    def _columns(self, part: torch.Tensor) -> torch.Tensor:
        """Return columns of the table at all rows in it so far, shape (k, p)."""
        unit = torch.zeros(self._mortar.count, len(part), dtype=torch.float32)
        unit[part, torch.arange(len(part))] = 1.0
        loads = self.spread(unit)
        if self._halves:
            columns = self._halves.add(part, loads[self._free])
        else:
            columns = self.rows(self.apply(loads))[self._order]
        # The present rows are the last in order; their part is symmetric but for rounding.
        columns[-len(part) :] = (columns[-len(part) :] + columns[-len(part) :].T) / 2
        return columns

    def held(self, residual: torch.Tensor, used: torch.Tensor, forces: Forces) -> torch.Tensor:
        """Return K0^-1 (r - M^T f), as `RestSolver`: by PARDISO one solve, else two."""
        if not self._halves:
            return _held(self, residual, forces)
        result = torch.zeros(residual.shape, dtype=torch.float32)
        result[self._free] = self._halves.held(residual[self._free], used, forces)
        return result


class DenseRest:
    """Inverse of the rest stiffness as a full matrix on a GPU: one product serves a whole batch.

    Scaled to a unit diagonal and rounded to half precision, at half the memory and several times the rate of single.
    Rounding is harmless: it is a preconditioner. But its constraints must use exactly the same matrix. So their
    compliance M K0^-1 M^T is taken from the rounded one, and sums are kept in single precision. M K0^-1 is kept too,
    each row scaled to unit compliance: its product with a residual costs a quarter of the whole inverse's.
    """

    _SHIFT = 2e-4
    """Added to the unit diagonal, so that rounding (2^-12) leaves the matrix positive [1]."""
    _ALIGNED = 64
    """Rows are padded to a multiple of this: its library falls back to kernels of half the rate where rows do not
    begin at multiples of 16 bytes."""
    _LARGEST = 1024.0
    """To which right-hand sides are scaled, clear of both ends of half precision."""
    _BLOCK = 2048
    """Columns of M K0^-1 made at a time."""

    def __init__(self, stiffness: sp.csr_matrix, unfixed: np.ndarray, rows: sp.csr_matrix, device: str) -> None:
        """Invert; arguments as of `rest_solver`, ``unfixed`` the degrees of freedom that are not held."""
        # Two matrices in double precision while the inverse is made (0007).
        need = 2 * 8 * len(unfixed) ** 2
        have = need if device == "cpu" else torch.cuda.mem_get_info(device)[0]
        if need > have:
            raise SolveError(
                f"a mesh with {len(unfixed)} degrees of freedom, whose inverse takes {need / 2**30:.0f} GiB on "
                f"{device}",
                f"at most {have / 2**30:.0f} GiB",
                "coarsen the mesh, or use device cpu",
            )
        reduced = stiffness[unfixed][:, unfixed].tocoo()
        place = torch.as_tensor(np.stack([reduced.row, reduced.col]), dtype=torch.int64, device=device)
        inverse = torch.zeros(reduced.shape, dtype=torch.float64, device=device)
        inverse[place[0], place[1]] = torch.as_tensor(reduced.data, device=device)
        # A dense inverse on a GPU: a product with it is one call at full speed, where sparse solves are sequences of
        # small ones.
        inverse = torch.cholesky_inverse(torch.linalg.cholesky(inverse))
        # A unit diagonal uses the range of half precision evenly.
        scale = inverse.diagonal().sqrt()
        inverse /= scale[:, None]
        inverse /= scale
        inverse.diagonal().add_(self._SHIFT)
        self.device, self._order = device, torch.as_tensor(unfixed, device=device)
        self.order = self._order.to(torch.int32)
        """Degree of freedom of every row, shape (k,)."""
        self.scale = scale.to(torch.float32)
        """By which a right-hand side is multiplied, and then the product, shape (k,)."""
        self._scale = self.scale[:, None]
        self.padded = -(-len(unfixed) // self._ALIGNED) * self._ALIGNED
        """Rows that `times` takes: one for every entry of ``order``, and zeros."""
        self._inverse = torch.zeros(len(unfixed), self.padded, dtype=torch.float16, device=device)
        self._inverse[:, : len(unfixed)] = inverse
        del inverse
        self._mortar = _MortarRows(rows, device)
        self.count = self._mortar.count
        """Number of mortar rows."""
        self._compliance(rows, unfixed)
        self.spreads = SpreadRows(rows, unfixed, device)
        if device != "cpu":
            # What the inverse in double precision took is for other processes on this GPU.
            torch.cuda.empty_cache()

    def _compliance(self, rows: sp.csr_matrix, unfixed: np.ndarray) -> None:
        """Make M K0^-1 and M K0^-1 M^T of the rounded inverse."""
        mortar = compressed_rows(
            sp.csr_matrix(rows[:, unfixed] @ sp.diags_array(self.scale.cpu().numpy())), self.device
        )
        compliance = torch.empty(self.count, len(self.order), device=self.device)
        for start in range(0, len(self.order), self._BLOCK):
            part = self._inverse[start : start + self._BLOCK, : len(self.order)].T.to(torch.float32)
            # The rounded inverse is symmetric, as rounding is a function of the number alone.
            compliance[:, start : start + self._BLOCK] = mortar @ part
        self._table = mortar @ compliance.T.contiguous()
        self._table = (self._table + self._table.T) / 2
        self.row_scale = self._table.diagonal().clamp_min(1e-30).sqrt().contiguous()
        """By which the product of `rows_times` is multiplied, shape (m,)."""
        self._rows = torch.zeros(self.count, self.padded, dtype=torch.float16, device=self.device)
        self._rows[:, : len(self.order)] = compliance / self.row_scale[:, None]

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (3n, b), float32."""
        result = torch.zeros(residual.shape, dtype=torch.float32, device=residual.device)
        scaled = residual[self._order] * self._scale
        size = scaled.abs().amax(dim=0).clamp_min(1e-30) / self._LARGEST
        half = torch.nn.functional.pad((scaled / size).to(torch.float16), (0, 0, 0, self.padded - len(scaled)))
        result[self._order] = self.times(half) * size * self._scale
        return result

    def rows(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return M z, as `RestSolver`."""
        return self._mortar.down @ displacement

    def spread(self, forces: torch.Tensor) -> torch.Tensor:
        """Return M^T f, as `RestSolver`."""
        return self._mortar.up @ forces

    def table(self, used: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 M^T [mm/N], as `RestSolver`: all of it."""
        return self._table

    def held(self, residual: torch.Tensor, used: torch.Tensor, forces: Forces) -> torch.Tensor:
        """Return K0^-1 (r - M^T f), as `RestSolver`."""
        return _held(self, residual, forces)

    def times(self, scaled: torch.Tensor) -> torch.Tensor:
        """Return the scaled inverse times ``scaled``.

        Args:
            scaled: right-hand sides in the order of `order`, scaled by `scale`, shape (padded, b), float16;
                rows beyond those of ``order`` are not read into the result.

        Returns:
            The product before it is scaled, shape (k, b), float32.
        """
        return _product(self._inverse, scaled)

    def rows_times(self, scaled: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 times ``scaled``, before it is scaled by `row_scale`, shape (m, b); see `times`."""
        return _product(self._rows, scaled)


class SpreadRows:
    """M^T on the free degrees of freedom, row by row, as a kernel takes it."""

    def __init__(self, rows: sp.csr_matrix, unfixed: np.ndarray, device: str) -> None:
        """Choose the rows that are not empty."""
        up = sp.csr_matrix(sp.csr_matrix(rows.T)[unfixed])
        loaded = np.flatnonzero(np.diff(up.indptr))
        up = sp.csr_matrix(up[loaded])

        def number(values: np.ndarray) -> torch.Tensor:
            return torch.as_tensor(values.astype(np.int32), device=device)

        self.row = number(loaded)
        """Place among the free degrees of freedom, shape (l,)."""
        self.start, self.column = number(up.indptr), number(up.indices)
        """Entries of each row, and the mortar row of each."""
        self.value = torch.as_tensor(up.data.astype(np.float32), device=device)
        """The entries."""


def _product(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return a product of matrices in half precision, its sums and result in single."""
    return torch.mm(a, b, out_dtype=torch.float32) if a.is_cuda else a.float() @ b.float()
