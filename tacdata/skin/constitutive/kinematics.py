"""Volume change, isochoric invariants and their derivatives, as Warp functions of the displacement gradient.

With H = F - I every quantity that vanishes at rest is summed from small terms, never taken as a difference of numbers
near 1. In single precision J - 1 and I1bar - 3 would otherwise keep three digits at a strain of 1e-3.

Notation of the functions: H displacement gradient; K = cof F - I; j = J - 1; D a direction dF. The tensor cross product
F x D = d(cof F)[D] follows Bonet, Gil and Ortigosa (2015), Comput. Methods Appl. Mech. Engrg. 283, 1061-1094.
"""

from functools import cache
from types import SimpleNamespace

from tacdata.warp_runtime import wp


def matrix(real: type) -> type:
    """Return the 3 x 3 matrix type of a scalar type."""
    return wp.types.matrix(shape=(3, 3), dtype=real)


def parameters(real: type) -> type:
    """Return the type of a law's numbers for a scalar type."""
    return wp.types.vector(length=8, dtype=real)


@cache
def volume(real: type) -> SimpleNamespace:
    """Return Warp functions of the volume change.

    - ``cofactor_change(H)`` = K
    - ``change(H, K)`` = j, NaN where J <= 0: so every law is NaN for a state turned inside out
    - ``cross(A, B)`` = A x B
    - ``scale(j)`` = J^(-2/3)
    - ``shifted(A, d)`` = A + d I
    """
    mat33 = matrix(real)
    nan = wp.constant(real(float("nan")))
    third = wp.constant(real(1.0 / 3.0))

    @wp.func
    def shifted(A: mat33, d: real):
        # Adding d times the unit matrix would cost 15 operations on zeros.
        return mat33(A[0, 0] + d, A[0, 1], A[0, 2], A[1, 0], A[1, 1] + d, A[1, 2], A[2, 0], A[2, 1], A[2, 2] + d)

    @wp.func
    def cofactor(A: mat33):
        a, b, c = wp.cross(A[1], A[2]), wp.cross(A[2], A[0]), wp.cross(A[0], A[1])
        return wp.matrix_from_rows(a, b, c)

    @wp.func
    def cofactor_change(H: mat33):
        return shifted(cofactor(H) - wp.transpose(H), wp.trace(H))

    @wp.func
    def change(H: mat33, K: mat33):
        # tr H + tr cof H + det H, since tr K = 2 tr H + tr cof H and H : K = (tr H)^2 - tr H^2 + 3 det H.
        t = wp.trace(H)
        c = wp.trace(K) - t - t
        j = t + c + third * (wp.ddot(H, K) - c - c)
        return wp.where(j > real(-1.0), j, nan)

    @wp.func
    def cross(A: mat33, B: mat33):
        a = wp.cross(A[1], B[2]) + wp.cross(B[1], A[2])
        b = wp.cross(A[2], B[0]) + wp.cross(B[2], A[0])
        c = wp.cross(A[0], B[1]) + wp.cross(B[0], A[1])
        return wp.matrix_from_rows(a, b, c)

    @wp.func
    def scale(j: real):
        # A GPU takes several times as long for a power.
        root = wp.cbrt(real(1.0) + j)
        return real(1.0) / (root * root)

    return SimpleNamespace(cofactor_change=cofactor_change, change=change, cross=cross, scale=scale, shifted=shifted)
