"""Arruda-Boyce, eight chains: the inverse Langevin function to five terms in I1bar, + kappa/2 (J - 1)^2."""

from dataclasses import dataclass
from functools import cache
from math import comb
from typing import Self

from tacdata.skin.constitutive import first_invariant, kinematics
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp

SERIES = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
"""C1 to C5 of W = mu0 sum_i C_i / N^(i-1) (I1bar^i - 3^i) (Arruda and Boyce 1993, J. Mech. Phys. Solids 41, 389)."""


@dataclass(frozen=True)
class ArrudaBoyce(Law):
    """A network of chains of N links; stiffens as they straighten."""

    inverse_links: float = 0.0
    """1 / N [1], N = (locking stretch)^2; 0 for chains without end."""

    @classmethod
    def example(cls) -> Self:
        """Return one with a locking stretch of 2."""
        return cls(inverse_links=0.25)

    def complaint(self) -> str:
        """Return the fault of the links."""
        if 0 <= self.inverse_links <= 1:
            return ""
        return f"inverse_links = {self.inverse_links:g}, allowed are 0 to 1 (chains of one link or more)"

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu, kappa [MPa] and the coefficients of x^k, k = 1 to 5, of w(x) [1], x = I1bar - 3."""
        weights = [c * self.inverse_links**i for i, c in enumerate(SERIES)]
        powers = [0.0] * 6
        # With I1bar = x + 3 the binomial theorem turns I1bar^i - 3^i into powers of x, and the sum starts near 0 at
        # rest.
        for i, weight in enumerate(weights, start=1):
            for k in range(1, i + 1):
                powers[k] += weight * comb(i, k) * 3.0 ** (i - k)
        # The stated shear modulus is that at rest, which asks for w'(0) = 1/2.
        return shear_modulus, bulk_modulus, *(0.5 * p / powers[1] for p in powers[1:])

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return the functions of the polynomial w(x)."""
        numbers = kinematics.parameters(real)

        @wp.func
        def value(x: real, m: numbers):
            return x * (m[2] + x * (m[3] + x * (m[4] + x * (m[5] + x * m[6]))))

        @wp.func
        def slope(x: real, m: numbers):
            higher = real(3.0) * m[4] + x * (real(4.0) * m[5] + x * real(5.0) * m[6])
            return m[2] + x * (real(2.0) * m[3] + x * higher)

        @wp.func
        def curvature(x: real, m: numbers):
            return real(2.0) * m[3] + x * (real(6.0) * m[4] + x * (real(12.0) * m[5] + x * real(20.0) * m[6]))

        return LawFunctions(*first_invariant.functions(real, first_invariant.Profile(value, slope, curvature)))
