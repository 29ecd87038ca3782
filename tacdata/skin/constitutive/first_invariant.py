"""Laws whose isochoric part depends on the first invariant alone: W = mu w(I1bar - 3) + kappa/2 (J - 1)^2."""

from typing import NamedTuple

from tacdata.skin.constitutive import invariants, kinematics, split
from tacdata.warp_runtime import wp


class Profile(NamedTuple):
    """The function w of x = I1bar - 3 as Warp functions ``f(x, m)``, ``m`` being the law's numbers; w'(0) = 1/2."""

    value: wp.Function
    """w [1]."""
    slope: wp.Function
    """w' [1]."""
    curvature: wp.Function
    """w'' [1]."""


def functions(real: type, profile: Profile) -> tuple[wp.Function, ...]:
    """Return energy, stress and tangent; m[0] is mu, m[1] kappa."""
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
    volume, first, excess = kinematics.volume(real), invariants.first(real), invariants.excesses(real).first
    cofactor_change, volume_change = volume.cofactor_change, volume.change
    invariant_slope, invariant_change = first.slope, first.change
    value, slope, curvature = profile.value, profile.slope, profile.curvature

    @wp.func
    def energy(H: mat33, m: numbers):
        return m[0] * value(excess(H), m)

    @wp.func
    def isochoric_stress(H: mat33, m: numbers):
        K = cofactor_change(H)
        return m[0] * slope(excess(H), m) * invariant_slope(H, K, volume_change(H, K))

    @wp.func
    def isochoric_tangent(H: mat33, dF: mat33, m: numbers):
        K = cofactor_change(H)
        j = volume_change(H, K)
        x = excess(H)
        A = invariant_slope(H, K, j)
        bending = curvature(x, m) * wp.ddot(A, dF) * A
        return m[0] * (slope(x, m) * invariant_change(H, K, j, A, dF) + bending)

    return split.with_volumetric(real, energy, isochoric_stress, isochoric_tangent)
