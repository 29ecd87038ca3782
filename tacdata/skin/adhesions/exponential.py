"""Strongest where the surfaces touch, falling exponentially: t = w/d exp(-gap/d)."""

from functools import cache

from tacdata.skin.adhesions.adhesion_law import AdhesionLaw
from tacdata.warp_runtime import wp


class Exponential(AdhesionLaw):
    """Initially rigid, as Camacho and Ortiz (Int. J. Solids Struct. 33 (1996) 2899) ask of a cohesive law."""

    # exp(-12) = 6e-6 of the work lies beyond.
    reach = 12.0

    @staticmethod
    @cache
    def functions() -> tuple[wp.Function, wp.Function, wp.Function]:
        """Return exp(-s), -exp(-s), exp(-s)."""

        @wp.func
        def shape(s: wp.float64):
            return wp.exp(-s)

        @wp.func
        def slope(s: wp.float64):
            return -wp.exp(-s)

        return shape, slope, shape
