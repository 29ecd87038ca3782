"""Strongest where the surfaces touch, falling along a line to nothing at a gap of one range: t = 2w/d (1 - gap/d)."""

from functools import cache

from tacdata.skin.adhesions.adhesion_law import AdhesionLaw
from tacdata.warp_runtime import wp


class Linear(AdhesionLaw):
    """The linear law of Camacho and Ortiz (Int. J. Solids Struct. 33 (1996) 2899)."""

    reach = 1.0

    @staticmethod
    @cache
    def functions() -> tuple[wp.Function, wp.Function, wp.Function]:
        """Return 2 (1 - s), -2, (1 - s)^2, all 0 beyond s = 1."""

        @wp.func
        def shape(s: wp.float64):
            return wp.float64(2.0) * wp.max(wp.float64(1.0) - s, wp.float64(0.0))

        @wp.func
        def slope(s: wp.float64):
            if s < wp.float64(1.0):
                return wp.float64(-2.0)
            return wp.float64(0.0)

        @wp.func
        def rest(s: wp.float64):
            remainder = wp.max(wp.float64(1.0) - s, wp.float64(0.0))
            return remainder * remainder

        return shape, slope, rest
