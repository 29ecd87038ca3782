"""Exponential and logarithm near their zeros, as Warp functions: Warp has neither expm1 nor log1p."""

from functools import cache

from tacdata.warp_runtime import wp


@cache
def log1p_ratio(real: type) -> wp.Function:
    """Return ``f(d)`` = ln(1 + d) / d, 1 at d = 0, to rounding for every d > -1; NaN for d <= -1."""

    @wp.func
    def ratio(d: real):
        one = real(1.0)
        if wp.abs(d) >= real(0.25):
            return wp.log(one + d) / d
        # ln(1 + d) = 2 artanh z, z = d / (2 + d); |z| < 1/7, so nine terms suffice.
        z = d / (real(2.0) + d)
        total = real(0.0)
        for k in range(9):
            total = total * z * z + one / real(17 - 2 * k)
        return total * real(2.0) / (real(2.0) + d)

    return ratio


@cache
def expm1_ratio(real: type) -> wp.Function:
    """Return ``f(y)`` = (exp(y) - 1) / y, 1 at y = 0, to rounding."""

    @wp.func
    def ratio(y: real):
        one = real(1.0)
        if wp.abs(y) >= real(0.5):
            return (wp.exp(y) - one) / y
        # Taylor's series by Horner's rule: its next term is below the rounding of double precision for |y| < 1/2.
        total = one
        for k in range(13):
            total = one + total * y / real(14 - k)
        return total

    return ratio


@cache
def exp_excess(real: type) -> wp.Function:
    """Return ``f(y)`` = exp(y) - 1 - y, to rounding."""

    @wp.func
    def excess(y: real):
        one = real(1.0)
        if wp.abs(y) >= real(0.5):
            return wp.exp(y) - one - y
        # The same series, begun at y^2 / 2.
        total = one
        for k in range(12):
            total = one + total * y / real(14 - k)
        return real(0.5) * y * y * total

    return excess
