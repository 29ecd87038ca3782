"""Nothing where the surfaces touch, strongest at a gap of one range: t = w/d (gap/d) exp(-gap/d)."""

from functools import cache

from tacdata.skin.adhesions.adhesion_law import AdhesionLaw
from tacdata.warp_runtime import wp


class XuNeedleman(AdhesionLaw):
    """The normal part of Xu and Needleman's law (Modelling Simul. Mater. Sci. Eng. 1 (1993) 111)."""

    # (1 + 15) exp(-15) = 5e-6 of the work lies beyond.
    reach = 15.0

    @staticmethod
    @cache
    def functions() -> tuple[wp.Function, wp.Function, wp.Function]:
        """Return s exp(-s), (1 - s) exp(-s), (1 + s) exp(-s)."""

        @wp.func
        def shape(s: wp.float64):
            return s * wp.exp(-s)

        @wp.func
        def slope(s: wp.float64):
            return (wp.float64(1.0) - s) * wp.exp(-s)

        @wp.func
        def rest(s: wp.float64):
            return (wp.float64(1.0) + s) * wp.exp(-s)

        return shape, slope, rest
