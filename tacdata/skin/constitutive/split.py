"""The volumetric-isochoric split: an isochoric law plus kappa/2 (J - 1)^2."""

from tacdata.skin.constitutive import kinematics
from tacdata.warp_runtime import wp


def with_volumetric(
    real: type, energy: wp.Function, stress: wp.Function, tangent: wp.Function
) -> tuple[wp.Function, ...]:
    """Return energy, stress and tangent of the whole law.

    Args:
        real: Scalar type of the functions.
        energy: Isochoric ``f(H, m)`` [MPa].
        stress: Isochoric ``f(H, m)`` [MPa].
        tangent: Isochoric ``f(H, dF, m)`` [MPa]. In all of them m[1] is left to kappa [MPa].
    """
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
    volume = kinematics.volume(real)
    cofactor_change, volume_change = volume.cofactor_change, volume.change
    cross, shifted = volume.cross, volume.shifted

    @wp.func
    def whole_energy(H: mat33, m: numbers):
        j = volume_change(H, cofactor_change(H))
        # The isochoric energy is blind to the sign of J; the NaN of this term makes the whole law refuse J <= 0.
        return energy(H, m) + real(0.5) * m[1] * j * j

    @wp.func
    def whole_stress(H: mat33, m: numbers):
        K = cofactor_change(H)
        pressure = m[1] * volume_change(H, K)
        return stress(H, m) + pressure * shifted(K, real(1.0))

    @wp.func
    def whole_tangent(H: mat33, dF: mat33, m: numbers):
        K = cofactor_change(H)
        F, cof = shifted(H, real(1.0)), shifted(K, real(1.0))
        swelling = wp.ddot(cof, dF) * cof + volume_change(H, K) * cross(F, dF)
        return tangent(H, dF, m) + m[1] * swelling

    return whole_energy, whole_stress, whole_tangent
