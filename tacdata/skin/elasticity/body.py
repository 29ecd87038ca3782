"""Internal forces of the skin and their linearization, matrix-free, for a batch of states of one mesh.

Fields are laid out (nodes, 3, batch), the batch innermost. Neighbouring threads of a GPU then read neighbouring
numbers, and a field is the right-hand side of a matrix product without a copy.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp
import torch
from scipy.sparse.csgraph import reverse_cuthill_mckee

from tacdata.skin.elasticity.averaged_volume import AveragedVolume, corner_shapes
from tacdata.skin.elasticity.element_functions import constant_data, element_data, element_functions
from tacdata.skin.elasticity.prepared_tangent import PreparedTangent
from tacdata.skin.materials import load_law
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.warp_arrays import REAL, argument, filled
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.warp_runtime import wp


@cache
def element_kernels(law_name: str, real: type) -> SimpleNamespace:
    """Compile the element kernels of one law in one precision."""
    law = load_law(law_name)
    energy_of, stress_of = law.energy_function(real, "H"), law.stress_function(real, "H")
    tangent_of = law.tangent_function(real, "H")
    ElementData, ConstantData = element_data(real), constant_data(real)
    of_element = element_functions(real)
    gather, gradient, forces, add = of_element.gather, of_element.gradient, of_element.forces, of_element.add
    constants, stretch, Nodal = of_element.constants, of_element.stretch, of_element.Nodal

    @wp.kernel(module="unique", enable_backward=False)
    def internal_force(
        u: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        force: wp.array3d(dtype=real),
        smallest_volume_ratio: wp.array(dtype=real),
    ):
        """Nodal forces of one element, and the smallest det F."""
        e, b = wp.tid()
        values, result, c = gather(u, mesh, e, b), Nodal(), constants(material, b)
        s = stretch(mesh, material, e, b)
        smallest = real(1.0e30)
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            smallest = wp.min(smallest, wp.determinant(wp.identity(n=3, dtype=real) + H))
            P = stress_of(H, c) * (mesh.weights[e, q] * s)
            result += forces(P, mesh, e, q, s)
        wp.atomic_min(smallest_volume_ratio, b, smallest)
        add(result, mesh, e, b, force)

    @wp.kernel(module="unique", enable_backward=False)
    def tangent_product(
        u: wp.array3d(dtype=real),
        p: wp.array3d(dtype=real),
        mesh: ElementData,
        material: ConstantData,
        product: wp.array3d(dtype=real),
    ):
        """Tangent stiffness of one element times nodal displacements ``p``."""
        e, b = wp.tid()
        values, changes = gather(u, mesh, e, b), gather(p, mesh, e, b)
        result, c = Nodal(), constants(material, b)
        s = stretch(mesh, material, e, b)
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            dP = tangent_of(H, gradient(changes, mesh, e, q, s), c) * (mesh.weights[e, q] * s)
            result += forces(dP, mesh, e, q, s)
        add(result, mesh, e, b, product)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(u: wp.array3d(dtype=real), mesh: ElementData, material: ConstantData, total: wp.array(dtype=real)):
        """Strain energy of one element."""
        e, b = wp.tid()
        values, c = gather(u, mesh, e, b), constants(material, b)
        s = stretch(mesh, material, e, b)
        for q in range(4):
            H = gradient(values, mesh, e, q, s)
            wp.atomic_add(total, b, energy_of(H, c) * (mesh.weights[e, q] * s))

    return SimpleNamespace(internal_force=internal_force, tangent_product=tangent_product, energy=energy)


class Elasticity:
    """The elastic body: a mesh and a law on one device. Constants and thickness are each batch member's own."""

    def __init__(self, mesh: SkinMesh, law: str, device: str = "cpu", averaged: bool = False) -> None:
        """Place the mesh on a device.

        Args:
            mesh: The mesh.
            law: File name in `tacdata/skin/materials`.
            device: "cpu" or "cuda:0".
            averaged: Whether volume changes are averaged at the corners (`averaged_volume`).

        Raises:
            SolveError: If an element is flat or turned inside out.
        """
        self.device, self.mesh, self.law = device, mesh, law
        # Elements of the slab stretch with its thickness; protrusions below z = 0 keep their size.
        slab = mesh.nodes[mesh.tets[:, :4], 2].mean(axis=1) > 0
        self._data = _data(mesh, slab, device)
        self._averaged = AveragedVolume(mesh, law, slab, self._data, device) if averaged else None

    @property
    def averages(self) -> bool:
        """Whether volume changes are averaged at the corners."""
        return self._averaged is not None

    def internal_force(self, u: torch.Tensor, conditions: Conditions) -> tuple[torch.Tensor, torch.Tensor]:
        """Return nodal forces [N], shape (n, 3, b), and the smallest det F [1], shape (b,), of displacements [mm]."""
        force = torch.zeros_like(u)
        ratio = torch.full((u.shape[2],), torch.inf, dtype=u.dtype, device=u.device)
        if self._averaged:
            self._averaged.add_force(u, conditions.to(u.dtype), ratio, force)
        else:
            self._launch("internal_force", (u,), conditions, force, ratio)
        return force, ratio

    def dilatation(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor | None:
        """Return the averaged volume change at the corners [1], shape (c, b); None where volumes are not averaged.

        All products with one tangent have it in common: whoever takes many passes it to `tangent_product`.
        """
        return self._averaged.dilatation(u, conditions.to(u.dtype)) if self._averaged else None

    def prepared(self) -> PreparedTangent | None:
        """Return the prepared tangents of a batch; None on a GPU, or for a body without averages."""
        return PreparedTangent(self._averaged) if self._averaged and self.device == "cpu" else None

    def tangent_product(
        self,
        u: torch.Tensor,
        p: torch.Tensor,
        conditions: Conditions,
        product: torch.Tensor,
        dilatation: torch.Tensor | None = None,
    ) -> None:
        """Add K(u) p [N] to ``product``; all of shape (n, 3, b) and of one precision.

        ``dilatation``, if given, is the result of `dilatation` for ``u``.
        """
        if self._averaged:
            material = conditions.to(u.dtype)
            dilatations = self._averaged.dilatation(u, material) if dilatation is None else dilatation
            self._averaged.add_product(u, p, material, dilatations, product)
        else:
            self._launch("tangent_product", (u, p), conditions, product)

    def energy(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return the strain energy [N mm], shape (b,)."""
        total = torch.zeros(u.shape[2], dtype=u.dtype, device=u.device)
        if self._averaged:
            self._averaged.add_energy(u, conditions.to(u.dtype), total)
        else:
            self._launch("energy", (u,), conditions, total)
        return total

    def _launch(self, name: str, fields: tuple[torch.Tensor, ...], conditions: Conditions, *out: torch.Tensor) -> None:
        real = REAL[fields[0].dtype]
        # Forces are computed in double precision, products with the tangent in single: Newton's method corrects their
        # rounding.
        material = conditions.to(fields[0].dtype)
        constants = filled(
            constant_data(real), law=material.law, modulus=material.modulus, thickness=material.thickness
        )
        wp.launch(
            getattr(element_kernels(self.law, real), name),
            dim=(len(self.mesh.tets), fields[0].shape[2]),
            inputs=[*map(argument, fields), self._data[fields[0].dtype], constants],
            outputs=[*map(argument, out)],
            device=self.device,
        )


def _data(mesh: SkinMesh, slab: np.ndarray, device: str) -> dict[torch.dtype, Any]:
    """Return a mesh as kernels take it, by precision."""
    corners = np.unique(mesh.tets[:, :4], return_inverse=True)[1].reshape(-1, 4)
    order = _neighbours_together(mesh.tets)
    arrays = {
        name: wp.array(values[order].astype(np.int32), dtype=wp.int32, device=device)
        for name, values in (("tets", mesh.tets), ("corners", corners), ("slab", slab))
    }
    slopes, weights = (values[order] for values in mesh.shape_gradients())
    return {
        dtype: filled(
            element_data(real),
            **arrays,
            shapes=wp.array(corner_shapes(), dtype=real, device=device),
            slopes=wp.array(slopes, dtype=real, device=device),
            at_points=wp.array(slopes, dtype=wp.types.matrix((10, 3), real), device=device),
            weights=wp.array(weights, dtype=real, device=device),
        )
        for dtype, real in REAL.items()
    }


def _neighbours_together(tets: np.ndarray) -> np.ndarray:
    """Return an order of elements in which neighbours follow one another, shape (e,).

    A GPU works on some hundred elements at a time. In this order their nodes are read once into its cache: 2.6 rows an
    element come from memory, and 6.7 in the mesh generator's order, where the cache holds 400 nodes.
    """
    element = np.repeat(np.arange(len(tets)), tets.shape[1])
    incidence = sp.csr_matrix((np.ones(tets.size, dtype=np.int32), (element, tets.ravel())))
    return reverse_cuthill_mckee(sp.csr_matrix(incidence @ incidence.T), symmetric_mode=True)
