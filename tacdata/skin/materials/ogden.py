"""Ogden: W = sum_p 2 mu s_p / a_p^2 (l1^a_p + l2^a_p + l3^a_p - 3) + kappa/2 (J - 1)^2, l_i isochoric stretches."""

from dataclasses import dataclass
from functools import cache
from typing import Self

from tacdata.skin.constitutive import kinematics, principal, scalars, split
from tacdata.skin.materials.law import Law, LawFunctions
from tacdata.warp_runtime import wp

TERMS = 3


@dataclass(frozen=True)
class Ogden(Law):
    """Up to three powers of the principal stretches (Ogden 1972, Proc. R. Soc. A 326, 565), as Abaqus scales them."""

    exponent: tuple[float, ...] = (2.0,)
    """Powers a_p [1], not 0, one a term; 2 is Neo-Hookean, (2, -2) Mooney-Rivlin."""
    share: tuple[float, ...] = (1.0,)
    """Shares s_p of the shear modulus [1], one a term, with the sum 1."""

    @classmethod
    def example(cls) -> Self:
        """Return three terms, one of a negative power."""
        return cls(exponent=(1.3, 5.0, -2.0), share=(0.7, 0.1, 0.2))

    def complaint(self) -> str:
        """Return the fault of exponents and shares."""
        if not 1 <= len(self.exponent) == len(self.share) <= TERMS:
            return (
                f"{len(self.exponent)} exponents and {len(self.share)} shares; allowed are as many of one as of the "
                f"other, 1 to {TERMS}"
            )
        if any(not 0.1 <= abs(a) <= 30 for a in self.exponent):
            return f"exponent = {list(self.exponent)}, allowed are powers from 0.1 to 30, of either sign"
        if abs(sum(self.share) - 1) > 1e-9:
            return f"the shares add up to {sum(self.share):g}, allowed is 1: Young's modulus fixes the stiffness"
        return ""

    def numbers(self, shear_modulus: float, bulk_modulus: float) -> tuple[float, ...]:
        """Return mu, kappa [MPa], three exponents and three shares [1]; unused terms have the share 0."""
        padding = TERMS - len(self.exponent)
        return shear_modulus, bulk_modulus, *self.exponent, *([2.0] * padding), *self.share, *([0.0] * padding)

    @staticmethod
    @cache
    def functions(real: type) -> LawFunctions:
        """Return W, P = F sum_i S_i N_i (x) N_i + kappa (J - 1) cof F, and dP, exact for equal stretches too."""
        mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
        vec3 = wp.types.vector(length=3, dtype=real)
        third = wp.constant(real(1.0 / 3.0))
        expm1_ratio, exp_excess = scalars.expm1_ratio(real), scalars.exp_excess(real)
        axes, log_stretches = principal.axes(real), principal.log_stretches(real)
        along_axes, divided = principal.along_axes(real), principal.divided_difference(real)

        @wp.func
        def powers_less_1(a: real, logs: vec3):
            result = vec3()
            for i in range(3):
                result[i] = a * logs[i] * expm1_ratio(a * logs[i])
            return result

        @wp.func
        def kirchhoff(logs: vec3, m: numbers):
            # Principal values of the deviatoric Kirchhoff stress: dW / d ln l_i
            result = vec3()
            for p in range(3):
                x = powers_less_1(m[2 + p], logs)
                mean = third * (x[0] + x[1] + x[2])
                for i in range(3):
                    result[i] += real(2.0) * m[0] * m[5 + p] / m[2 + p] * (x[i] - mean)
            return result

        @wp.func
        def energy(H: mat33, m: numbers):
            logs = log_stretches(axes(H).strains)
            total = real(0.0)
            for p in range(3):
                a = m[2 + p]
                # The isochoric logarithms add up to 0, so that subtracting them changes nothing but the rounding.
                terms = exp_excess(a * logs[0]) + exp_excess(a * logs[1]) + exp_excess(a * logs[2])
                total += real(2.0) * m[0] * m[5 + p] / (a * a) * terms
            return total

        @wp.func
        def stress(H: mat33, m: numbers):
            found = axes(H)
            tau = kirchhoff(log_stretches(found.strains), m)
            # From tau = F S F^T the second Piola-Kirchhoff stress has the principal values tau_i / c_i.
            S = along_axes(found.axes, wp.diag(wp.cw_div(tau, found.strains + vec3(real(1.0)))))
            return (wp.identity(n=3, dtype=real) + H) * S

        @wp.func
        def tangent(H: mat33, dF: mat33, m: numbers):
            found = axes(H)
            F = wp.identity(n=3, dtype=real) + H
            c, logs = found.strains + vec3(real(1.0)), log_stretches(found.strains)
            tau = kirchhoff(logs, m)
            dC = wp.transpose(found.axes) * (wp.transpose(dF) * F + wp.transpose(F) * dF) * found.axes
            dS = mat33()
            # Change of S_i = tau_i / c_i by its denominator; that by tau_i follows.
            for i in range(3):
                dS[i, i] = -tau[i] / (c[i] * c[i]) * dC[i, i]
            for p in range(3):
                a, factor = m[2 + p], real(2.0) * m[0] * m[5 + p]
                x = powers_less_1(a, logs) + vec3(real(1.0))
                mean = third * (x[0] + x[1] + x[2])
                for i in range(3):
                    dtau = x[i] * dC[i, i] / c[i]
                    # The isochoric stretches contain all three c_k through J, so that each dtau_i does.
                    for k in range(3):
                        dtau += third * (mean - x[i] - x[k]) * dC[k, k] / c[k]
                    dS[i, i] += real(0.5) * factor * dtau / c[i]
                    # The axes turn: dS_ik = (S_i - S_k) / (c_i - c_k) dC_ik, where only the part in tau_i - tau_k
                    # needs the divided difference. The other part, tau_k / (c_i c_k), follows in the last loop.
                    for k in range(3):
                        if k != i:
                            slope = factor / a * divided(a, logs[k], c[i], c[k])
                            dS[i, k] += slope / c[i] * dC[i, k]
            for i in range(3):
                for k in range(3):
                    if k != i:
                        dS[i, k] -= tau[k] / (c[i] * c[k]) * dC[i, k]
            S = along_axes(found.axes, wp.diag(wp.cw_div(tau, c)))
            return dF * S + F * along_axes(found.axes, dS)

        return LawFunctions(*split.with_volumetric(real, energy, stress, tangent))
