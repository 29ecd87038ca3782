"""Volume change averaged at the corners of the elements, so that quadratic tetrahedra do not lock.

Four points an element constrain as many volumes as the nodes have motions to give. Near incompressibility the mesh is
then too stiff. Here the part kappa/2 (J - 1)^2 of the law is taken of a projection of J - 1: onto functions that are
continuous and linear in every element. So there is one volume to keep for each corner. That is Taylor and Hood's mixed
element (Computers & Fluids 1 (1973) 73) with its pressure eliminated:

    energy = sum_q w (W - kappa/2 j^2) + kappa/2 b^T Q b,   b_a = sum_q w N_a j,   j = J - 1

Q is an approximate inverse of the mass matrix M of the N_a: the lumped mass D, corrected by Richardson's iteration,
Q = sum_i (1 - D^-1 M)^i D^-1. It is symmetric and positive at any number of corrections.
"""

from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp
import torch

from tacdata.skin.elasticity.averaged_kernels import averaged_kernels
from tacdata.skin.elasticity.element_functions import constant_data
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.warp_runtime import wp

CORRECTIONS = 3
"""Steps of Richardson's iteration; each takes two orders of the element's size off the error of lumping."""


@cache
def mass_kernel(real: type) -> wp.Kernel:
    """Compile the kernel of a step of Richardson's iteration, in one precision."""

    @wp.kernel(module="unique", enable_backward=False)
    def correct(
        first: wp.array(dtype=wp.int32),
        neighbour: wp.array(dtype=wp.int32),
        mass: wp.array2d(dtype=real),
        lumped: wp.array2d(dtype=real),
        thickness: wp.array(dtype=real),
        sums: wp.array2d(dtype=real),
        estimate: wp.array2d(dtype=real),
        corrected: wp.array2d(dtype=real),
    ):
        # after = before + D^-1 (sums - M before); with before = 0 it is the lumped average.
        a, b = wp.tid()
        s, spread = thickness[b], real(0.0)
        for k in range(first[a], first[a + 1]):
            spread += (mass[0, k] + s * mass[1, k]) * estimate[neighbour[k], b]
        corrected[a, b] = estimate[a, b] + (sums[a, b] - spread) / (lumped[0, a] + s * lumped[1, a])

    return correct


class AveragedVolume:
    """Forces, tangent and energy of a mesh with averaged volume changes."""

    def __init__(
        self, mesh: SkinMesh, law: str, slab: np.ndarray, data: dict[torch.dtype, Any], device: str = "cpu"
    ) -> None:
        """Prepare the averages.

        Args:
            mesh: The mesh.
            law: File name in tacdata/skin/materials.
            slab: Which elements stretch with the slab's thickness, shape (e,), bool.
            data: The mesh as kernels take it (`element_functions.element_data`), by precision.
            device: "cpu" or "cuda:0".
        """
        _, weights = mesh.shape_gradients()
        corner, tets = np.unique(mesh.tets[:, :4], return_inverse=True)
        self.law, self.corners, self.elements = law, len(corner), len(mesh.tets)
        self._device = device
        tets = tets.reshape(-1, 4)
        # Two matrices, as only the slab's volume scales with a member's thickness; the kernel adds them.
        mass = [corner_mass(tets, weights * part[:, None], self.corners) for part in (~slab, slab)]
        # Absolute values, so that entries that cancel in the sum keep their place.
        pattern = sp.csr_matrix(sum(abs(m) for m in mass) + sp.identity(self.corners, format="csr") * 0)
        pattern.sort_indices()
        values = [_on_pattern(m, pattern) for m in mass]
        lumped = np.stack([np.asarray(m.sum(axis=1)).ravel() for m in mass])
        self.data = data
        self.pattern = [
            wp.array(a.astype(np.int32), dtype=wp.int32, device=device) for a in (pattern.indptr, pattern.indices)
        ]
        self.mass = {
            dtype: [wp.array(np.ascontiguousarray(a), dtype=real, device=device) for a in (np.stack(values), lumped)]
            for dtype, real in REAL.items()
        }

    def dilatation(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return the averaged J - 1 at the corners [1], shape (c, b)."""
        return self._average(self._sums("dilatation", (u,), conditions), conditions)

    def add_force(self, u: torch.Tensor, conditions: Conditions, smallest: torch.Tensor, force: torch.Tensor) -> None:
        """Add the internal forces [N] at displacements ``u`` [mm], both of shape (n, 3, b).

        Args:
            u: Displacements.
            conditions: Conditions, in the precision of ``u``.
            smallest: Lowered to the smallest det F [1], shape (b,).
            force: Receives the forces.
        """
        self._launch("force", (u,), conditions, self.dilatation(u, conditions), smallest, force)

    def add_product(
        self, u: torch.Tensor, p: torch.Tensor, conditions: Conditions, dilatation: torch.Tensor, product: torch.Tensor
    ) -> None:
        """Add K(u) p [N]; all of shape (n, 3, b) and of one precision; ``dilatation``: that at ``u``."""
        change = self._average(self._sums("dilatation_change", (u, p), conditions), conditions)
        self._launch("product", (u, p), conditions, dilatation, change, product)

    def add_energy(self, u: torch.Tensor, conditions: Conditions, total: torch.Tensor) -> None:
        """Add the strain energy [N mm], shape (b,)."""
        self._launch("energy", (u,), conditions, self.dilatation(u, conditions), total)

    def _sums(self, name: str, fields: tuple[torch.Tensor, ...], conditions: Conditions) -> torch.Tensor:
        sums = torch.zeros(self.corners, fields[0].shape[2], dtype=fields[0].dtype, device=fields[0].device)
        self._launch(name, fields, conditions, sums)
        return sums

    def _average(self, sums: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return Q times sums over the corners' surroundings, shape (c, b)."""
        average = torch.zeros_like(sums)
        # The first pass starts from 0 and gives the lumped average; the corrections follow.
        for _ in range(CORRECTIONS + 1):
            corrected = torch.empty_like(sums)
            wp.launch(
                mass_kernel(REAL[sums.dtype]),
                dim=tuple(sums.shape),
                inputs=[*self.pattern, *self.mass[sums.dtype], *map(argument, (conditions.thickness, sums, average))],
                outputs=[argument(corrected)],
                device=self._device,
            )
            average = corrected
        return average

    def _launch(
        self, name: str, fields: tuple[torch.Tensor, ...], conditions: Conditions, *arrays: torch.Tensor
    ) -> None:
        """Run a kernel on fields; the last of ``arrays`` receives the result."""
        dtype = fields[0].dtype
        real = REAL[dtype]
        constants = filled(
            constant_data(real), law=conditions.law, modulus=conditions.modulus, thickness=conditions.thickness
        )
        wp.launch(
            getattr(averaged_kernels(self.law, real), name),
            dim=(self.elements, fields[0].shape[2]),
            inputs=[*map(argument, fields), self.data[dtype], constants, *map(argument, arrays)],
            device=self._device,
        )


def averaged_stiffness(mesh: SkinMesh, bulk_modulus: float) -> sp.csr_matrix:
    """Return the volumetric stiffness at rest [N/mm], shape (3n, 3n), by the lumped average alone.

    That is as far as a preconditioner must know it.

    Args:
        mesh: The mesh.
        bulk_modulus: kappa [MPa].
    """
    slopes, weights = mesh.shape_gradients()
    corner, tets = np.unique(mesh.tets[:, :4], return_inverse=True)
    tets, shapes = tets.reshape(-1, 4), corner_shapes()
    divergence = np.einsum("eq,qa,eqni->eani", weights, shapes, slopes)
    rows = np.broadcast_to(tets[:, :, None, None], divergence.shape)
    columns = np.broadcast_to((3 * mesh.tets[:, :, None] + np.arange(3))[:, None], divergence.shape)
    size = (len(corner), 3 * len(mesh.nodes))
    b = sp.csr_matrix(sp.coo_matrix((divergence.ravel(), (rows.ravel(), columns.ravel())), shape=size))
    lumped = np.bincount(tets.ravel(), (weights @ shapes).ravel(), minlength=len(corner))
    return sp.csr_matrix(b.T @ sp.diags(bulk_modulus / lumped) @ b)


def corner_shapes() -> np.ndarray:
    """Return the corners' linear shape functions at an element's quadrature points [1], shape (4, 4)."""
    points = elements.tetrahedron_quadrature()[0]
    return np.concatenate([1 - points.sum(axis=1, keepdims=True), points], axis=1)


def corner_mass(tets: np.ndarray, weights: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the mass matrix of linear shape functions [mm^3], shape (count, count).

    Args:
        tets: Corners of the elements, shape (e, 4).
        weights: Of the quadrature points [mm^3], shape (e, 4).
        count: Number of corners.
    """
    shapes = corner_shapes()
    blocks = np.einsum("eq,qa,qb->eab", weights, shapes, shapes)
    rows, columns = np.repeat(tets, 4, axis=1).ravel(), np.tile(tets, (1, 4)).ravel()
    return sp.csr_matrix(sp.coo_matrix((blocks.ravel(), (rows, columns)), shape=(count, count)))


def _on_pattern(matrix: sp.csr_matrix, pattern: sp.csr_matrix) -> np.ndarray:
    """Return a matrix's entries in the order of a wider pattern's."""
    rows = np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))
    return np.asarray(matrix[rows, pattern.indices]).ravel()
