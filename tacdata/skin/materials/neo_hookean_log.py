# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Neo-Hookean, coupled logarithmic form: W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2."""

import warp as wp

from tacdata.sensor import Material
from tacdata.skin.materials.law import Law

Parameters = wp.types.vector(length=8, dtype=wp.float64)


@wp.func
def _energy(F: wp.mat33d, m: Parameters):
    half = wp.float64(0.5)
    L = wp.log(wp.determinant(F))
    return m[0] * half * (wp.ddot(F, F) - wp.float64(3.0)) - m[0] * L + m[1] * half * L * L


@wp.func
def _stress(F: wp.mat33d, m: Parameters):
    G = wp.transpose(wp.inverse(F))
    return m[0] * (F - G) + m[1] * wp.log(wp.determinant(F)) * G


@wp.func
def _tangent(F: wp.mat33d, dF: wp.mat33d, m: Parameters):
    G = wp.transpose(wp.inverse(F))
    dG = -(G * wp.transpose(dF) * G)
    L = wp.log(wp.determinant(F))
    return m[0] * (dF - dG) + m[1] * (wp.ddot(G, dF) * G + L * dG)


class NeoHookeanLog(Law):
    """The textbook form (Bonet and Wood 2008, eq. 6.27)."""

    def parameters(self, material: Material) -> tuple[float, ...]:
        """Return mu and lambda = kappa - 2 mu / 3 [MPa]."""
        return material.shear_modulus, material.bulk_modulus - 2 * material.shear_modulus / 3

    def energy_function(self) -> wp.Function:
        """Return W."""
        return _energy

    def stress_function(self) -> wp.Function:
        """Return P = mu (F - F^-T) + lambda ln J F^-T."""
        return _stress

    def tangent_function(self) -> wp.Function:
        """Return dP."""
        return _tangent
