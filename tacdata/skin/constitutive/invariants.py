"""The isochoric invariants I1bar = J^(-2/3) I1 and I2bar = J^(-4/3) I2, their derivatives and second derivatives.

Notation as in `kinematics.py`. With C = F^T F = c (I + D), D traceless, both invariants follow from D alone. With
q = D:D/2 - det D it holds that det(C)/c^3 = 1 - q. So I1bar = 3 (1 - q)^(-1/3), without a difference of numbers near 3.
"""

from functools import cache
from types import SimpleNamespace

from tacdata.skin.constitutive.kinematics import matrix, volume
from tacdata.warp_runtime import wp


@cache
def excesses(real: type) -> SimpleNamespace:
    """Return Warp functions ``first(H)`` = I1bar - 3 and ``second(H)`` = I2bar - 3, blind to the sign of J."""
    mat33 = matrix(real)
    vec2 = wp.types.vector(length=2, dtype=real)
    third, half, shifted = wp.constant(real(1.0 / 3.0)), wp.constant(real(0.5)), volume(real).shifted

    @wp.func
    def distortion(H: mat33):
        one = real(1.0)
        E = H + wp.transpose(H) + wp.transpose(H) * H
        mean = third * wp.trace(E)
        # c = 1 + mean carries the swelling, so that D vanishes with the distortion.
        D = shifted(E, -mean) / (one + mean)
        r = half * wp.ddot(D, D)
        return vec2(r, r - wp.determinant(D))

    @wp.func
    def growth(q: real):
        # t - 1 for t = (1 - q)^(-1/3), from t^3 - 1 = q / (1 - q).
        one = real(1.0)
        t = one / wp.cbrt(one - q)
        return q / (one - q) / (t * t + t + one)

    @wp.func
    def first(H: mat33):
        return real(3.0) * growth(distortion(H)[1])

    @wp.func
    def second(H: mat33):
        d = distortion(H)
        g = growth(d[1])
        t = real(1.0) + g
        return real(3.0) * g * (t + real(1.0)) - d[0] * t * t

    return SimpleNamespace(first=first, second=second)


@cache
def first(real: type) -> SimpleNamespace:
    """Return Warp functions ``slope(H, K, j)`` = dI1bar/dF and ``change(H, K, j, slope, D)``, its change along D."""
    mat33 = matrix(real)
    parts = volume(real)
    scale, cross, shifted = parts.scale, parts.cross, parts.shifted
    third, two_thirds = wp.constant(real(1.0 / 3.0)), wp.constant(real(2.0 / 3.0))

    @wp.func
    def deficit(H: mat33, j: real):
        # 1 - I1 / 3J
        return (j - two_thirds * wp.trace(H) - third * wp.ddot(H, H)) / (real(1.0) + j)

    @wp.func
    def slope(H: mat33, K: mat33, j: real):
        # 2 J^(-2/3) (F - I1/3J cof F)
        b = deficit(H, j)
        return real(2.0) * scale(j) * shifted(H - (real(1.0) - b) * K, b)

    @wp.func
    def change(H: mat33, K: mat33, j: real, slope: mat33, D: mat33):
        one = real(1.0)
        F, cof = shifted(H, one), shifted(K, one)
        a = one - deficit(H, j)
        g = wp.ddot(cof, D) / (one + j)
        da = two_thirds * wp.ddot(F, D) / (one + j) - a * g
        return -two_thirds * g * slope + real(2.0) * scale(j) * (D - da * cof - a * cross(F, D))

    return SimpleNamespace(slope=slope, change=change)


@cache
def second(real: type) -> SimpleNamespace:
    """Return Warp functions ``slope(H, K, j)`` = dI2bar/dF and ``change(H, K, j, slope, D)``, its change along D."""
    mat33 = matrix(real)
    parts = volume(real)
    scale, cross, shifted = parts.scale, parts.cross, parts.shifted
    two_thirds = wp.constant(real(2.0 / 3.0))

    @wp.func
    def ratio(j: real, strain: mat33):
        # 2 - 2/3 I2/J, where I2 = 3 + 2 tr E + tr cof E
        t = wp.trace(strain)
        minors = real(0.5) * (t * t - wp.ddot(strain, strain))
        return two_thirds * (real(3.0) * j - real(2.0) * t - minors) / (real(1.0) + j)

    @wp.func
    def slope(H: mat33, K: mat33, j: real):
        # 2 J^(-4/3) (F (I1 I - C) - 2/3 I2/J cof F)
        two, s = real(2.0), scale(j)
        E = H + wp.transpose(H) + wp.transpose(H) * H
        b, t = ratio(j, E), wp.trace(E)
        inner = shifted(-E, t)
        return two * s * s * shifted(inner + two * H + H * inner - (two - b) * K, b)

    @wp.func
    def change(H: mat33, K: mat33, j: real, slope: mat33, D: mat33):
        one, two = real(1.0), real(2.0)
        s = scale(j)
        F, cof = shifted(H, one), shifted(K, one)
        C = wp.transpose(F) * F
        E = H + wp.transpose(H) + wp.transpose(H) * H
        inner = shifted(-C, real(3.0) + wp.trace(E))
        dC = wp.transpose(D) * F + wp.transpose(F) * D
        dinner = shifted(-dC, wp.trace(dC))
        b = two - ratio(j, E)
        g = wp.ddot(cof, D) / (one + j)
        db = real(2.0) * two_thirds * wp.ddot(F * inner, D) / (one + j) - b * g
        dB = D * inner + F * dinner
        return -two * two_thirds * g * slope + two * s * s * (dB - db * cof - b * cross(F, D))

    return SimpleNamespace(slope=slope, change=change)
