"""Gent: W = -mu Jm/2 ln(1 - (I1bar - 3)/Jm) + kappa/2 (J - 1)^2: chains that cannot be stretched without end."""

from dataclasses import dataclass
from functools import cache
from typing import Self

from tacdata.skin.constitutive import first_invariant, kinematics, scalars
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp

LOCKED = 0.98
"""Share of Jm beyond which w' goes on along its tangent [1], so that an iterate beyond the pole is no NaN."""


@dataclass(frozen=True)
class Gent(Law):
    """Limited extensibility (Gent 1996, Rubber Chem. Technol. 69, 59)."""

    stiffening: float = 0.0
    """1 / Jm [1]: the inverse of the largest I1bar - 3; 0 for chains without end."""

    @classmethod
    def example(cls) -> Self:
        """Return one that locks at I1bar - 3 = 10."""
        return cls(stiffening=0.1)

    def complaint(self) -> str:
        """Return the fault of the stiffening."""
        return "" if 0 <= self.stiffening <= 10 else f"stiffening = {self.stiffening:g}, allowed are 0 to 10"

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu, kappa [MPa] and 1/Jm [1]."""
        return shear_modulus, bulk_modulus, self.stiffening

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return the functions of w(x) = -Jm/2 ln(1 - x/Jm)."""
        numbers, half, end = kinematics.parameters(real), wp.constant(real(0.5)), wp.constant(real(LOCKED))
        log1p_ratio = scalars.log1p_ratio(real)

        @wp.func
        def curvature(x: real, m: numbers):
            room = real(1.0) - wp.min(m[2] * x, end)
            return half * m[2] / (room * room)

        @wp.func
        def slope(x: real, m: numbers):
            y = wp.min(m[2] * x, end)
            room = real(1.0) - y
            return half / room + half * (m[2] * x - y) / (room * room)

        @wp.func
        def value(x: real, m: numbers):
            y = wp.min(m[2] * x, end)
            room = real(1.0) - y
            if y < end:
                # Through ln(1 - y) / -y there is no division by m[2] = 1/Jm, and a stiffening of 0 gives the
                # Neo-Hookean x/2.
                return half * x * log1p_ratio(-y)
            excess = m[2] * x - y
            return half * (-wp.log(room) + excess / room + half * excess * excess / (room * room)) / m[2]

        return LawFunctions(*first_invariant.functions(real, first_invariant.Profile(value, slope, curvature)))
