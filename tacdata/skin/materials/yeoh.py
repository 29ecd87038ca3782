"""Yeoh: W = C1 (I1bar - 3) + C2 (I1bar - 3)^2 + C3 (I1bar - 3)^3 + kappa/2 (J - 1)^2."""

from dataclasses import dataclass
from functools import cache
from typing import Self

from tacdata.skin.constitutive import first_invariant, kinematics
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp


@dataclass(frozen=True)
class Yeoh(Law):
    """Stiffening or softening with I1bar alone (Yeoh 1993, Rubber Chem. Technol. 66, 754); C1 = mu/2."""

    c2_over_c1: float = 0.0
    """C2 / C1 [1]; often small and negative."""
    c3_over_c1: float = 0.0
    """C3 / C1 [1]; positive, or the material collapses at large strain."""

    @classmethod
    def example(cls) -> Self:
        """Return one that softens, then stiffens."""
        return cls(c2_over_c1=-0.05, c3_over_c1=0.02)

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu, kappa [MPa], C2/C1 and C3/C1 [1]."""
        return shear_modulus, bulk_modulus, self.c2_over_c1, self.c3_over_c1

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return the functions of w(x) = (x + c2 x^2 + c3 x^3) / 2."""
        numbers, half = kinematics.parameters(real), wp.constant(real(0.5))

        @wp.func
        def value(x: real, m: numbers):
            return half * x * (real(1.0) + x * (m[2] + x * m[3]))

        @wp.func
        def slope(x: real, m: numbers):
            return half + x * (m[2] + real(1.5) * m[3] * x)

        @wp.func
        def curvature(x: real, m: numbers):
            return m[2] + real(3.0) * m[3] * x

        return LawFunctions(*first_invariant.functions(real, first_invariant.Profile(value, slope, curvature)))
