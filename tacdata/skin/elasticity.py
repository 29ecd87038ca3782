# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Internal forces of the skin and their linearization, matrix-free, for a batch of states of one mesh."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import torch
import warp as wp

from tacdata.sensor import Material
from tacdata.skin.materials import load_law
from tacdata.skin.mesh import SkinMesh

wp.config.log_level = wp.LOG_ERROR
wp.init()
Parameters = wp.types.vector(length=8, dtype=wp.float64)


@cache
def _kernels(law_name: str) -> SimpleNamespace:
    """Compile the element kernels of one law."""
    law = load_law(law_name)
    energy_of, stress_of, tangent_of = law.energy_function(), law.stress_function(), law.tangent_function()

    @wp.func
    def gradient(
        u: wp.array2d(dtype=wp.vec3d), tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=wp.float64),
        b: int, e: int, q: int,
    ):
        H = wp.mat33d()
        for a in range(10):
            g = wp.vec3d(slopes[e, q, a, 0], slopes[e, q, a, 1], slopes[e, q, a, 2])
            H += wp.outer(u[b, tets[e, a]], g)
        return H

    @wp.kernel(module="unique")
    def internal_force(
        u: wp.array2d(dtype=wp.vec3d), tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=wp.float64),
        weights: wp.array2d(dtype=wp.float64), m: Parameters,
        force: wp.array2d(dtype=wp.vec3d), smallest_volume_ratio: wp.array(dtype=wp.float64),
    ):
        b, e = wp.tid()
        identity = wp.identity(n=3, dtype=wp.float64)
        for q in range(4):
            F = identity + gradient(u, tets, slopes, b, e, q)
            wp.atomic_min(smallest_volume_ratio, b, wp.determinant(F))
            P = stress_of(F, m) * weights[e, q]
            for a in range(10):
                g = wp.vec3d(slopes[e, q, a, 0], slopes[e, q, a, 1], slopes[e, q, a, 2])
                wp.atomic_add(force, b, tets[e, a], P * g)

    @wp.kernel(module="unique")
    def tangent_product(
        u: wp.array2d(dtype=wp.vec3d), p: wp.array2d(dtype=wp.vec3d),
        tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=wp.float64),
        weights: wp.array2d(dtype=wp.float64), m: Parameters, product: wp.array2d(dtype=wp.vec3d),
    ):
        b, e = wp.tid()
        identity = wp.identity(n=3, dtype=wp.float64)
        for q in range(4):
            F = identity + gradient(u, tets, slopes, b, e, q)
            dP = tangent_of(F, gradient(p, tets, slopes, b, e, q), m) * weights[e, q]
            for a in range(10):
                g = wp.vec3d(slopes[e, q, a, 0], slopes[e, q, a, 1], slopes[e, q, a, 2])
                wp.atomic_add(product, b, tets[e, a], dP * g)

    @wp.kernel(module="unique")
    def energy(
        u: wp.array2d(dtype=wp.vec3d), tets: wp.array2d(dtype=wp.int32), slopes: wp.array4d(dtype=wp.float64),
        weights: wp.array2d(dtype=wp.float64), m: Parameters, total: wp.array(dtype=wp.float64),
    ):
        b, e = wp.tid()
        identity = wp.identity(n=3, dtype=wp.float64)
        for q in range(4):
            wp.atomic_add(total, b, energy_of(identity + gradient(u, tets, slopes, b, e, q), m) * weights[e, q])

    return SimpleNamespace(internal_force=internal_force, tangent_product=tangent_product, energy=energy)


class Elasticity:
    """The elastic body: mesh, law and elastic constants on one device."""

    def __init__(self, mesh: SkinMesh, material: Material, device: str = "cpu") -> None:
        """Place the mesh on ``device`` ("cpu" or "cuda:0") and compile the law's kernels."""
        slopes, weights = mesh.shape_gradients()
        self.device = device
        self.mesh = mesh
        self.material = material
        self.element_count = len(mesh.tets)
        self._tets = wp.array(mesh.tets, dtype=wp.int32, device=device)
        self._slopes = wp.array(slopes, dtype=wp.float64, device=device)
        self._weights = wp.array(weights, dtype=wp.float64, device=device)
        values = load_law(material.law).parameters(material)
        self._parameters = Parameters(*values, *([0.0] * (8 - len(values))))
        self._kernels = _kernels(material.law)

    def internal_force(self, u: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return nodal forces [N], shape (b, n, 3), and the smallest det F [1], shape (b,), of displacements [mm]."""
        force = torch.zeros_like(u)
        ratio = torch.full((u.shape[0],), np.inf, dtype=torch.float64, device=u.device)
        wp.launch(
            self._kernels.internal_force, dim=(u.shape[0], self.element_count),
            inputs=[vectors(u), self._tets, self._slopes, self._weights, self._parameters],
            outputs=[vectors(force), wp.from_torch(ratio)], device=self.device,
        )
        return force, ratio

    def tangent_product(self, u: torch.Tensor, p: torch.Tensor, product: torch.Tensor) -> None:
        """Add K(u) p [N] to ``product``; all of shape (b, n, 3)."""
        wp.launch(
            self._kernels.tangent_product, dim=(u.shape[0], self.element_count),
            inputs=[vectors(u), vectors(p), self._tets, self._slopes, self._weights, self._parameters],
            outputs=[vectors(product)], device=self.device,
        )

    def energy(self, u: torch.Tensor) -> torch.Tensor:
        """Return the strain energy [N mm], shape (b,)."""
        total = torch.zeros(u.shape[0], dtype=torch.float64, device=u.device)
        wp.launch(
            self._kernels.energy, dim=(u.shape[0], self.element_count),
            inputs=[vectors(u), self._tets, self._slopes, self._weights, self._parameters],
            outputs=[wp.from_torch(total)], device=self.device,
        )
        return total


def vectors(tensor: torch.Tensor) -> wp.array:
    """View a contiguous tensor of shape (b, n, 3) as a Warp array of 3-vectors, without copying."""
    return wp.from_torch(tensor, dtype=wp.vec3d)
