# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false
"""Neo-Hookean, volumetric-isochoric split: W = mu/2 (I1bar - 3) + kappa/2 (J - 1)^2."""

import warp as wp

from tacdata.sensor import Material
from tacdata.skin.materials.law import Law

Parameters = wp.types.vector(length=8, dtype=wp.float64)

# Outside the functions: Warp would divide the literals in single precision.
_THIRD = wp.constant(wp.float64(1.0 / 3.0))
_POWER = wp.constant(wp.float64(-2.0 / 3.0))


@wp.func
def _energy(F: wp.mat33d, m: Parameters):
    J = wp.determinant(F)
    I1 = wp.ddot(F, F)
    one = wp.float64(1.0)
    return (
        m[0] * wp.float64(0.5) * (wp.pow(J, _POWER) * I1 - wp.float64(3.0))
        + m[1] * wp.float64(0.5) * (J - one) * (J - one)
    )


@wp.func
def _stress(F: wp.mat33d, m: Parameters):
    J = wp.determinant(F)
    G = wp.transpose(wp.inverse(F))
    I1 = wp.ddot(F, F)
    s = m[0] * wp.pow(J, _POWER)
    return s * F + (m[1] * (J - wp.float64(1.0)) * J - s * I1 / wp.float64(3.0)) * G


@wp.func
def _tangent(F: wp.mat33d, dF: wp.mat33d, m: Parameters):
    third = _THIRD
    J = wp.determinant(F)
    G = wp.transpose(wp.inverse(F))
    I1 = wp.ddot(F, F)
    s = m[0] * wp.pow(J, _POWER)
    g = wp.ddot(G, dF)
    dG = -(G * wp.transpose(dF) * G)
    p = m[1] * (J - wp.float64(1.0)) * J
    dp = m[1] * (wp.float64(2.0) * J - wp.float64(1.0)) * J * g
    two = wp.float64(2.0)
    return (
        s * dF
        - two * third * s * g * F
        + (dp + two * third * third * s * I1 * g - two * third * s * wp.ddot(F, dF)) * G
        + (p - third * s * I1) * dG
    )


class NeoHookean(Law):
    """The form of Abaqus and CalculiX (C10 = mu/2, D1 = 2/kappa), stable under volume change up to J near 0."""

    def parameters(self, material: Material) -> tuple[float, ...]:
        """Return mu and kappa [MPa]."""
        return material.shear_modulus, material.bulk_modulus

    def energy_function(self) -> wp.Function:
        """Return W."""
        return _energy

    def stress_function(self) -> wp.Function:
        """Return P = mu J^(-2/3) (F - I1/3 F^-T) + kappa (J - 1) J F^-T."""
        return _stress

    def tangent_function(self) -> wp.Function:
        """Return dP."""
        return _tangent
