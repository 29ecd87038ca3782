"""Neo-Hookean, volumetric-isochoric split: W = mu/2 (I1bar - 3) + kappa/2 (J - 1)^2."""

from dataclasses import dataclass
from functools import cache

from tacdata.skin.constitutive import invariants, kinematics, split
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp


@dataclass(frozen=True)
class NeoHookean(Law):
    """The form of Abaqus and CalculiX (C10 = mu/2, D1 = 2/kappa), stable under volume change up to J near 0."""

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu and kappa [MPa]."""
        return shear_modulus, bulk_modulus

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return W, P = mu J^(-2/3) (F - I1/3 F^-T) + kappa (J - 1) cof F, and dP."""
        mat33, numbers, half = kinematics.matrix(real), kinematics.parameters(real), wp.constant(real(0.5))
        volume, first, excess = kinematics.volume(real), invariants.first(real), invariants.excesses(real).first
        cofactor_change, volume_change = volume.cofactor_change, volume.change
        slope, slope_change = first.slope, first.change

        @wp.func
        def energy(H: mat33, m: numbers):
            return half * m[0] * excess(H)

        @wp.func
        def isochoric_stress(H: mat33, m: numbers):
            K = cofactor_change(H)
            return half * m[0] * slope(H, K, volume_change(H, K))

        @wp.func
        def isochoric_tangent(H: mat33, dF: mat33, m: numbers):
            K = cofactor_change(H)
            j = volume_change(H, K)
            return half * m[0] * slope_change(H, K, j, slope(H, K, j), dF)

        return LawFunctions(*split.with_volumetric(real, energy, isochoric_stress, isochoric_tangent))
