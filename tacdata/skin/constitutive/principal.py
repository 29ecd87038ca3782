"""Principal axes and stretches, as Warp functions for laws in principal stretches."""

from functools import cache

from tacdata.skin.constitutive import scalars
from tacdata.skin.constitutive.kinematics import matrix
from tacdata.warp_runtime import wp


@cache
def axes(real: type) -> wp.Function:
    """Return ``f(H)``: columns ``axes`` N_i and ``strains`` e_i of F^T F - I = sum_i e_i N_i (x) N_i; c_i = 1 + e_i."""
    mat33, vec3 = matrix(real), wp.types.vector(length=3, dtype=real)

    @wp.struct
    class Principal:
        axes: mat33
        strains: vec3

    @wp.func
    def principal(H: mat33):
        # In double precision always: in single, Warp's eig3 was seen to leave 2e-3 of the matrix.
        E = wp.mat33d(H + wp.transpose(H) + wp.transpose(H) * H)
        vectors, values = wp.eig3(E)
        result = Principal()
        result.axes = mat33(vectors)
        result.strains = vec3(values)
        return result

    return principal


@cache
def along_axes(real: type) -> wp.Function:
    """Return ``f(Q, A)`` = Q A Q^T: a tensor with the components A along the columns of Q."""
    mat33 = matrix(real)

    @wp.func
    def turned(Q: mat33, A: mat33):
        return Q * A * wp.transpose(Q)

    return turned


@cache
def log_stretches(real: type) -> wp.Function:
    """Return ``f(e)``: logarithms of the isochoric principal stretches, ln c_i / 2 less their mean."""
    vec3, log1p_ratio = wp.types.vector(length=3, dtype=real), scalars.log1p_ratio(real)
    third, half = wp.constant(real(1.0 / 3.0)), wp.constant(real(0.5))

    @wp.func
    def logs(e: vec3):
        result = vec3()
        for i in range(3):
            result[i] = half * e[i] * log1p_ratio(e[i])
        mean = third * (result[0] + result[1] + result[2])
        return result - vec3(mean)

    return logs


@cache
def divided_difference(real: type) -> wp.Function:
    """Return ``f(a, l, c_i, c_k)``: (x_i - x_k) / (c_i - c_k), x = isochoric stretch^a, its limit if c_i = c_k.

    ``l`` is the logarithm of the k-th isochoric stretch. With d = (c_i - c_k) / c_k the quotient is
    x_k / c_k (exp(a/2 ln(1 + d)) - 1) / d: no small difference is divided by another.
    """
    log1p_ratio, expm1_ratio = scalars.log1p_ratio(real), scalars.expm1_ratio(real)

    @wp.func
    def quotient(a: real, log_k: real, c_i: real, c_k: real):
        d = (c_i - c_k) / c_k
        slope = real(0.5) * a * log1p_ratio(d)
        return wp.exp(a * log_k) / c_k * slope * expm1_ratio(slope * d)

    return quotient
