"""Mooney-Rivlin: W = C10 (I1bar - 3) + C01 (I2bar - 3) + kappa/2 (J - 1)^2."""

from dataclasses import dataclass
from functools import cache
from typing import Self

from tacdata.skin.constitutive import invariants, kinematics, split
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp


@dataclass(frozen=True)
class MooneyRivlin(Law):
    """Two invariants; mu = 2 (C10 + C01)."""

    c01_share: float = 0.0
    """C01 / (C10 + C01) [1]; 0 is Neo-Hookean."""

    @classmethod
    def example(cls) -> Self:
        """Return one with a fifth of C01."""
        return cls(c01_share=0.2)

    def complaint(self) -> str:
        """Return the fault of the share."""
        return "" if 0 <= self.c01_share <= 1 else f"c01_share = {self.c01_share:g}, allowed are 0 to 1"

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu, kappa [MPa] and the share of C01 [1]."""
        return shear_modulus, bulk_modulus, self.c01_share

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return W, P = C10 dI1bar/dF + C01 dI2bar/dF + kappa (J - 1) cof F, and dP."""
        mat33, numbers, half = kinematics.matrix(real), kinematics.parameters(real), wp.constant(real(0.5))
        volume, excesses = kinematics.volume(real), invariants.excesses(real)
        cofactor_change, volume_change = volume.cofactor_change, volume.change
        first_excess, second_excess = excesses.first, excesses.second
        first_slope, first_change = invariants.first(real).slope, invariants.first(real).change
        second_slope, second_change = invariants.second(real).slope, invariants.second(real).change

        @wp.func
        def energy(H: mat33, m: numbers):
            return half * m[0] * ((real(1.0) - m[2]) * first_excess(H) + m[2] * second_excess(H))

        @wp.func
        def isochoric_stress(H: mat33, m: numbers):
            K = cofactor_change(H)
            j = volume_change(H, K)
            return half * m[0] * ((real(1.0) - m[2]) * first_slope(H, K, j) + m[2] * second_slope(H, K, j))

        @wp.func
        def isochoric_tangent(H: mat33, dF: mat33, m: numbers):
            K = cofactor_change(H)
            j = volume_change(H, K)
            of_first = first_change(H, K, j, first_slope(H, K, j), dF)
            of_second = second_change(H, K, j, second_slope(H, K, j), dF)
            return half * m[0] * ((real(1.0) - m[2]) * of_first + m[2] * of_second)

        return LawFunctions(*split.with_volumetric(real, energy, isochoric_stress, isochoric_tangent))
