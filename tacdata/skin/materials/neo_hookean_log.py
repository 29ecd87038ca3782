"""Neo-Hookean, coupled logarithmic form: W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2."""

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

from tacdata.skin.constitutive import kinematics, scalars
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp


@dataclass(frozen=True)
class NeoHookeanLog(Law):
    """The textbook form (Bonet and Wood 2008, eq. 6.27)."""

    splits_volume: ClassVar[bool] = False

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu and lambda = kappa - 2 mu / 3 [MPa]."""
        return shear_modulus, bulk_modulus - 2 * shear_modulus / 3

    @staticmethod
    @cache
    def bulk_function(real: type) -> wp.Function:
        """Return kappa = lambda + 2 mu / 3 [MPa]."""
        numbers = kinematics.parameters(real)
        share = wp.constant(real(2.0 / 3.0))

        @wp.func
        def bulk(m: numbers):
            return m[1] + share * m[0]

        return bulk

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return W, P = mu (F - F^-T) + lambda ln J F^-T, and dP."""
        mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
        volume = kinematics.volume(real)
        cofactor_change, volume_change = volume.cofactor_change, volume.change
        cross, shifted = volume.cross, volume.shifted
        log1p_ratio, exp_excess = scalars.log1p_ratio(real), scalars.exp_excess(real)

        @wp.func
        def energy(H: mat33, m: numbers):
            half = real(0.5)
            j = volume_change(H, cofactor_change(H))
            L = j * log1p_ratio(j)
            # (I1 - 3)/2 - ln J = tr H + H:H/2 - ln J by terms of second order: tr H = j - tr cof H - det H
            t, sym = wp.trace(H), half * (H + wp.transpose(H))
            minors = wp.ddot(sym, sym) - half * t * t - wp.determinant(H)
            # The rest is j - ln J = exp(L) - 1 - L, of second order as well.
            return m[0] * (minors + exp_excess(L)) + half * m[1] * L * L

        @wp.func
        def stress(H: mat33, m: numbers):
            K = cofactor_change(H)
            j = volume_change(H, K)
            J = real(1.0) + j
            # F - F^-T = (j I + J H - K) / J
            return (m[0] * shifted(J * H - K, j) + m[1] * j * log1p_ratio(j) * shifted(K, real(1.0))) / J

        @wp.func
        def tangent(H: mat33, dF: mat33, m: numbers):
            K = cofactor_change(H)
            j = volume_change(H, K)
            J = real(1.0) + j
            # G = F^-T, g = d ln J, dG = the change of F^-T along dF.
            G = shifted(K, real(1.0)) / J
            g = wp.ddot(G, dF)
            dG = cross(shifted(H, real(1.0)), dF) / J - g * G
            return m[0] * (dF - dG) + m[1] * (g * G + j * log1p_ratio(j) * dG)

        return LawFunctions(energy, stress, tangent)
