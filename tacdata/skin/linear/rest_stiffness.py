"""The rest state's stiffness, prepared once: the preconditioner of every press on a mesh."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.errors import SolveError
from tacdata.sensor import Material
from tacdata.skin.elasticity.averaged_volume import averaged_stiffness
from tacdata.skin.linear.cholesky import factor_of
from tacdata.skin.mesh.skin_mesh import SkinMesh


def rest_stiffness(mesh: SkinMesh, material: Material, averaged: bool = False) -> sp.csr_matrix:
    """Assemble the linear-elastic stiffness [N/mm], shape (3n, 3n): every law's tangent at F = I.

    With ``averaged`` volume changes (`tacdata.skin.elasticity.averaged_volume`) it is near it, as the average is
    lumped.
    """
    mu = material.shear_modulus
    lam = (0.0 if averaged else material.bulk_modulus) - 2 * mu / 3
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
    stiffness = sp.csr_matrix(sp.coo_matrix((blocks.ravel(), (rows, columns)), shape=(size, size)))
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

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (3n, b), float32."""
        ...

    def rows(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return M z, shape (m, b), of z, shape (3n, b), float32."""
        ...

    def spread(self, forces: torch.Tensor) -> torch.Tensor:
        """Return M^T f, shape (3n, b), of f, shape (m, b), float32."""
        ...

    def compliance(self, which: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 M^T [mm/N] between rows.

        Args:
            which: Numbers of rows of every member, shape (b, k); m stands for none.

        Returns:
            Shape (b, k, k), float32, symmetric, zero where there is none.
        """
        ...


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
    known = averaged and device != "cpu"
    stiffness = rest_stiffness(mesh, material if known == averaged else for_averaged(material), known)
    free = np.flatnonzero(~np.repeat(fixed, 3))
    return (SparseRest if device == "cpu" else DenseRest)(stiffness, free, rows, device)


class _MortarRows:
    """M and its transpose."""

    def __init__(self, rows: sp.csr_matrix, device: str) -> None:
        self.count = rows.shape[0]  # pyright: ignore[reportOptionalSubscript]
        self.down, self.up = (_sparse(matrix, device) for matrix in (rows, sp.csr_matrix(rows.T)))


def _sparse(matrix: sp.csr_matrix, device: str) -> torch.Tensor:
    indices = (torch.as_tensor(values.astype(np.int64)) for values in (matrix.indptr, matrix.indices))
    values = torch.as_tensor(matrix.data.astype(np.float32))
    return torch.sparse_csr_tensor(*indices, values, size=matrix.shape, dtype=torch.float32).to(device)


class SparseRest:
    """Sparse Cholesky factor of the rest stiffness on the free degrees of freedom.

    Kept in single precision: a preconditioner needs no more, and its two triangular solves are bound by memory.
    """

    _BLOCK = 64

    def __init__(self, stiffness: sp.csr_matrix, free: np.ndarray, rows: sp.csr_matrix, device: str = "cpu") -> None:
        """Factorize; arguments as of `rest_solver`, ``free`` the degrees of freedom that are not held."""
        self._free, self._mortar = torch.as_tensor(free), _MortarRows(rows, device)
        self._factor = factor_of(stiffness[free][:, free])
        # Rows are filled when a press first needs them and serve every later one; memory is taken as they are.
        count = self._mortar.count
        self._table = torch.from_numpy(np.empty((count + 1, count + 1), dtype=np.float32))
        self._table[-1] = 0.0
        self._known = torch.zeros(count + 1, dtype=torch.bool)
        self._known[-1] = True

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

    def compliance(self, which: torch.Tensor) -> torch.Tensor:
        """Return M K0^-1 M^T [mm/N] between rows, as in `RestSolver`."""
        wanted = torch.unique(which)
        missing = wanted[~self._known[wanted]]
        for start in range(0, len(missing), self._BLOCK):
            part = missing[start : start + self._BLOCK]
            unit = torch.zeros(self._mortar.count, len(part), dtype=torch.float32)
            unit[part, torch.arange(len(part))] = 1.0
            self._table[part, :-1] = self.rows(self.apply(self.spread(unit))).T
            self._table[part, -1] = 0.0
        self._known[missing] = True
        blocks = self._table[which[:, :, None], which[:, None, :]]
        return (blocks + blocks.transpose(1, 2)) / 2


class DenseRest:
    """Inverse of the rest stiffness as a full matrix on a GPU: one product serves a whole batch.

    Scaled to a unit diagonal and rounded to half precision, at half the memory and several times the rate of single.
    What is rounded is a preconditioner; what must hold exactly is that the Woodbury identity sees the same matrix. So
    the compliance is taken from the rounded one, and sums are kept in single precision.
    """

    _SHIFT = 2e-4
    """Added to the unit diagonal, so that rounding (2^-12) leaves the matrix positive [1]."""
    _ALIGNED = 64
    """Rows are padded to a multiple of this: its library falls back to kernels of half the rate where rows do not
    begin at multiples of 16 bytes."""
    _LARGEST = 1024.0
    """To which right-hand sides are scaled, clear of both ends of half precision."""

    def __init__(self, stiffness: sp.csr_matrix, free: np.ndarray, loadable: np.ndarray, device: str) -> None:
        """Invert; arguments as of `rest_solver`, ``free`` the degrees of freedom that are not held."""
        need = 2 * 8 * len(free) ** 2
        have = need if device == "cpu" else torch.cuda.mem_get_info(device)[0]
        if need > have:
            raise SolveError(
                f"a mesh with {len(free)} degrees of freedom, whose inverse takes {need / 2**30:.0f} GiB on {device}",
                f"at most {have / 2**30:.0f} GiB", "coarsen the mesh, or use device cpu",
            )
        # Loadable ones first, so that their rows are a view.
        order = np.concatenate([loadable, np.setdiff1d(free, loadable)])
        reduced = stiffness[order][:, order].tocoo()
        place = torch.as_tensor(np.stack([reduced.row, reduced.col]), dtype=torch.int64, device=device)
        inverse = torch.zeros(reduced.shape, dtype=torch.float64, device=device)
        inverse[place[0], place[1]] = torch.as_tensor(reduced.data, device=device)
        inverse = torch.cholesky_inverse(torch.linalg.cholesky(inverse))
        scale = inverse.diagonal().sqrt()
        inverse /= scale[:, None]
        inverse /= scale
        self.count, self._order = len(loadable), torch.as_tensor(order, device=device)
        self.order = self._order.to(torch.int32)
        """Degree of freedom of every row, the loadable ones' first, shape (k,); so many are ``count``."""
        self.scale = scale.to(torch.float32)
        """By which a right-hand side is multiplied, and then the product, shape (k,)."""
        self._scale = self.scale[:, None]
        inverse.diagonal().add_(self._SHIFT)
        self.padded = -(-len(order) // self._ALIGNED) * self._ALIGNED
        """Rows that `times` takes: one for every entry of ``order``, and zeros."""
        self._inverse = torch.zeros(len(order), self.padded, dtype=torch.float16, device=device)
        self._inverse[:, : len(order)] = inverse
        del inverse
        part = self._inverse[: self.count, : self.count].to(torch.float32)
        part *= self._scale[: self.count] * self._scale[: self.count].T
        self._table = torch.nn.functional.pad(part, (0, 1, 0, 1))

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 r, zero where held; shapes (3n, b), float32."""
        result = torch.zeros(residual.shape, dtype=torch.float32, device=residual.device)
        result[self._order] = self._times(self._inverse, residual) * self._scale
        return result

    def loadable(self, residual: torch.Tensor) -> torch.Tensor:
        """Return `apply` at the loadable degrees of freedom only, shape (m, b)."""
        return self._times(self._inverse[: self.count], residual) * self._scale[: self.count]

    def compliance(self, which: torch.Tensor) -> torch.Tensor:
        """Return K0^-1 [mm/N] between loadable degrees of freedom, as in `RestSolver`."""
        return self._table[which[:, :, None], which[:, None, :]]

    def _times(self, matrix: torch.Tensor, residual: torch.Tensor) -> torch.Tensor:
        scaled = residual[self._order] * self._scale
        size = scaled.abs().amax(dim=0).clamp_min(1e-30) / self._LARGEST
        half = torch.nn.functional.pad((scaled / size).to(torch.float16), (0, 0, 0, self.padded - len(scaled)))
        return _product(matrix, half) * size

    def times(self, scaled: torch.Tensor, rows: int | None = None) -> torch.Tensor:
        """Return the scaled inverse, or its first rows only, times ``scaled``.

        Args:
            scaled: right-hand sides in the order of `order`, scaled by `scale`, shape (padded, b), float16; what
                stands beyond the rows of ``order`` is not read into the result.
            rows: how many, k if None.

        Returns:
            The product before it is scaled, shape (rows, b), float32.
        """
        return _product(self._inverse[:rows], scaled)


def _product(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return a product of matrices in half precision, its sums and result in single."""
    return torch.mm(a, b, out_dtype=torch.float32) if a.is_cuda else a.float() @ b.float()
