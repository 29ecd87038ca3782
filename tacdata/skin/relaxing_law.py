# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false, reportInvalidTypeForm=false
"""The stress of a relaxing material point within a time step, as Warp functions of the displacement gradient H = F - I.

P = P_law + (a - 1) P_iso + F S_h, with a and S_h from `prony.py`. An elastic point has a = 1 and S_h = 0.
"""

from functools import cache
from typing import NamedTuple

import warp as wp

from tacdata.skin.constitutive import kinematics
from tacdata.skin.materials.law import Law


class RelaxingFunctions(NamedTuple):
    """Warp functions of one law in one precision."""

    stress: wp.Function
    """``f(H, a, S_h, m)``: first Piola-Kirchhoff stress P [MPa]."""
    tangent: wp.Function
    """``f(H, dF, a, S_h, m)``: its change along dF, the past held fixed [MPa]."""
    branch_stress: wp.Function
    """``f(H, m)``: long-term isochoric second Piola-Kirchhoff stress S = F^-1 P_iso [MPa], for `Prony.advance`."""


@cache
def relaxing_functions(kind: type[Law], real: type) -> RelaxingFunctions:
    """Return the functions of a law (its class) for ``wp.float64`` or ``wp.float32``."""
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
    law = kind.functions(real)
    of_law, of_law_tangent = law.stress, law.tangent
    isochoric, isochoric_tangent = law.isochoric_stress, law.isochoric_tangent

    @wp.func
    def stress(H: mat33, a: real, S_h: mat33, m: numbers):
        F = wp.identity(n=3, dtype=real) + H
        return of_law(H, m) + (a - real(1.0)) * isochoric(H, m) + F * S_h

    @wp.func
    def tangent(H: mat33, dF: mat33, a: real, S_h: mat33, m: numbers):
        return of_law_tangent(H, dF, m) + (a - real(1.0)) * isochoric_tangent(H, dF, m) + dF * S_h

    @wp.func
    def branch_stress(H: mat33, m: numbers):
        return wp.inverse(wp.identity(n=3, dtype=real) + H) * isochoric(H, m)

    return RelaxingFunctions(stress, tangent, branch_stress)
