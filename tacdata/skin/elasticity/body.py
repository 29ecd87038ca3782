# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Internal forces of the skin and their linearization, matrix-free, for a batch of states of one mesh.

Fields are laid out (nodes, 3, batch), the batch innermost: neighbouring threads of a card then read neighbouring
numbers, and a field is the right-hand side of a matrix product as it stands.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
import torch
import warp as wp

import tacdata.warp_runtime  # noqa: F401 - starts Warp
from tacdata.skin.elasticity.averaged_volume import AveragedVolume
from tacdata.skin.elasticity.element_functions import element_functions
from tacdata.skin.materials import load_law
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.warp_arrays import handed
from tacdata.skin.mesh.skin_mesh import SkinMesh

REAL = {torch.float32: wp.float32, torch.float64: wp.float64}
"""Warp's name of a scalar type."""


@cache
def _kernels(law_name: str, real: type) -> SimpleNamespace:
    """Compile the element kernels of one law in one precision."""
    law = load_law(law_name)
    energy_of, stress_of = law.energy_function(real, "H"), law.stress_function(real, "H")
    tangent_of = law.tangent_function(real, "H")
    of_element = element_functions(real)
    gather, slope, gradient, add = of_element.gather, of_element.slope, of_element.gradient, of_element.add
    constants, stretch, Nodal = of_element.constants, of_element.stretch, of_element.Nodal

    @wp.kernel(module="unique", enable_backward=False)
    def internal_force(
        u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=real),
        weights: wp.array2d(dtype=real), slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real),
        m: wp.array2d(dtype=real), force: wp.array3d(dtype=real), smallest_volume_ratio: wp.array(dtype=real),
    ):
        e, b = wp.tid()
        values, result, c = gather(u, tets, e, b), Nodal(), constants(m, b)
        s = stretch(slab, thickness, e, b)
        least = real(1.0e30)
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            least = wp.min(least, wp.determinant(wp.identity(n=3, dtype=real) + H))
            P = stress_of(H, c) * (weights[e, q] * s)
            for a in range(10):
                f = P * slope(slopes, e, q, a, s)
                for i in range(3):
                    result[a, i] = result[a, i] + f[i]
        wp.atomic_min(smallest_volume_ratio, b, least)
        add(result, tets, e, b, force)

    @wp.kernel(module="unique", enable_backward=False)
    def tangent_product(
        u: wp.array3d(dtype=real), p: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32),
        slopes: wp.array4d(dtype=real), weights: wp.array2d(dtype=real), slab: wp.array(dtype=wp.int32),
        thickness: wp.array(dtype=real), m: wp.array2d(dtype=real), product: wp.array3d(dtype=real),
    ):
        e, b = wp.tid()
        values, along = gather(u, tets, e, b), gather(p, tets, e, b)
        result, c = Nodal(), constants(m, b)
        s = stretch(slab, thickness, e, b)
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            dP = tangent_of(H, gradient(along, slopes, e, q, s), c) * (weights[e, q] * s)
            for a in range(10):
                f = dP * slope(slopes, e, q, a, s)
                for i in range(3):
                    result[a, i] = result[a, i] + f[i]
        add(result, tets, e, b, product)

    @wp.kernel(module="unique", enable_backward=False)
    def energy(
        u: wp.array3d(dtype=real), tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=real),
        weights: wp.array2d(dtype=real), slab: wp.array(dtype=wp.int32), thickness: wp.array(dtype=real),
        m: wp.array2d(dtype=real), total: wp.array(dtype=real),
    ):
        e, b = wp.tid()
        values, c = gather(u, tets, e, b), constants(m, b)
        s = stretch(slab, thickness, e, b)
        for q in range(4):
            H = gradient(values, slopes, e, q, s)
            wp.atomic_add(total, b, energy_of(H, c) * (weights[e, q] * s))

    return SimpleNamespace(internal_force=internal_force, tangent_product=tangent_product, energy=energy)


class Elasticity:
    """The elastic body: a mesh and a law on one device; elastic constants and thickness are each member's own."""

    def __init__(self, mesh: SkinMesh, law: str, device: str = "cpu", averaged: bool = False) -> None:
        """Place the mesh on ``device`` ("cpu" or "cuda:0"); ``averaged``: see `averaged_volume`."""
        slopes, weights = mesh.shape_gradients()
        self.device, self.mesh, self.law = device, mesh, law
        self._tets = wp.array(mesh.tets, dtype=wp.int32, device=device)
        # Elements of the slab stretch with its thickness; protrusions below z = 0 keep their size.
        slab = mesh.nodes[mesh.tets[:, :4], 2].mean(axis=1) > 0
        self._slab = wp.array(slab.astype(np.int32), dtype=wp.int32, device=device)
        self._averaged = AveragedVolume(mesh, law, slab, device) if averaged else None
        self._geometry = {
            dtype: (wp.array(slopes, dtype=real, device=device), wp.array(weights, dtype=real, device=device))
            for dtype, real in REAL.items()
        }

    def internal_force(self, u: torch.Tensor, conditions: Conditions) -> tuple[torch.Tensor, torch.Tensor]:
        """Return nodal forces [N], shape (n, 3, b), and the smallest det F [1], shape (b,), of displacements [mm]."""
        force = torch.zeros_like(u)
        ratio = torch.full((u.shape[2],), torch.inf, dtype=u.dtype, device=u.device)
        if self._averaged:
            self._averaged.add_force(u, conditions, ratio, force)
        else:
            self._launch("internal_force", u, (), conditions, force, ratio)
        return force, ratio

    def swelling(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor | None:
        """Return what many `tangent_product` at one state have in common, shape (c, b), if there is anything."""
        return self._averaged.average(u, conditions) if self._averaged else None

    def tangent_product(
        self, u: torch.Tensor, p: torch.Tensor, conditions: Conditions, product: torch.Tensor,
        swelling: torch.Tensor | None = None,
    ) -> None:
        """Add K(u) p [N] to ``product``; all of shape (n, 3, b) and of one precision.

        ``swelling``, if given, is what `swelling` returned for that state.
        """
        if self._averaged:
            self._averaged.add_product(u, p, conditions, product, swelling)
        else:
            self._launch("tangent_product", u, (p,), conditions, product)

    def energy(self, u: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return the strain energy [N mm], shape (b,)."""
        total = torch.zeros(u.shape[2], dtype=u.dtype, device=u.device)
        if self._averaged:
            self._averaged.add_energy(u, conditions, total)
        else:
            self._launch("energy", u, (), conditions, total)
        return total

    def _launch(
        self, name: str, u: torch.Tensor, more: tuple[torch.Tensor, ...], conditions: Conditions, *out: torch.Tensor
    ) -> None:
        kernel = getattr(_kernels(self.law, REAL[u.dtype]), name)
        slopes, weights = self._geometry[u.dtype]
        own = conditions.to(u.dtype)
        wp.launch(
            kernel, dim=(len(self.mesh.tets), u.shape[2]),
            inputs=[
                *map(handed, (u, *more)), self._tets, slopes, weights, self._slab,
                *map(handed, (own.thickness, own.law)),
            ],
            outputs=[*map(handed, out)], device=self.device,
        )
