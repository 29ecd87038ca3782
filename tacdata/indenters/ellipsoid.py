"""An ellipsoid with its axes along x, y, z."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Self

import numpy as np

from tacdata.indenters.indenter import Indenter, cut, warp

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function


@dataclass(frozen=True)
class Ellipsoid(Indenter):
    """An ellipsoid that touches with its lowest point."""

    a: float
    """Semi-axis along x [mm]."""
    b: float
    """Semi-axis along y [mm]."""
    c: float
    """Semi-axis along z [mm]."""

    @classmethod
    def example(cls) -> Self:
        """Return an oblong one, 6 x 4 x 3 mm."""
        return cls(a=3.0, b=2.0, c=1.5)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The semi-axes [mm]."""
        return (self.a, self.b, self.c)

    @property
    def extent(self) -> float:
        """The longer horizontal semi-axis [mm]."""
        return max(self.a, self.b)

    @property
    def height(self) -> float:
        """The vertical axis [mm]."""
        return 2 * self.c

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return c - c sqrt(1 - x^2/a^2 - y^2/b^2) [mm]."""
        inside = 1 - (x / self.a) ** 2 - (y / self.b) ** 2
        return np.where(inside >= 0, self.c - self.c * np.sqrt(np.maximum(inside, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance to the nearest point of the ellipsoid.

        That point is s_i^2 p_i / (s_i^2 + t) with the multiplier t at which it is on the surface
        (Eberly, "Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid", Geometric
        Tools, 2013). The root is found by Newton's method on 1/|w| - 1, w_i = s_i p_i / (s_i^2 + t),
        which is nearly linear in t (the secular equation of Moré & Sorensen, SIAM J. Sci. Stat. Comput.
        4, 1983). The loop has a constant count, so Warp unrolls it and differentiates it rightly.
        """
        wp = warp()

        @wp.func
        def ellipsoid_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            s = wp.vec3d(q[0], q[1], q[2])
            v = wp.vec3d(p[0], p[1], p[2] - q[2])
            s2 = wp.cw_mul(s, s)
            sp = wp.cw_mul(s, v)
            # Left of the root, where no |w_i| is below 1; kept off the pole at the centre.
            t = wp.max(wp.cw_mul(s, wp.vec3d(wp.abs(v[0]), wp.abs(v[1]), wp.abs(v[2]))) - s2)
            t = wp.max(t, wp.float64(-0.999999) * wp.min(s2))
            for _ in range(7):
                w = wp.vec3d(sp[0] / (s2[0] + t), sp[1] / (s2[1] + t), sp[2] / (s2[2] + t))
                slope = w[0] * w[0] / (s2[0] + t) + w[1] * w[1] / (s2[1] + t) + w[2] * w[2] / (s2[2] + t)
                norm = wp.length(w)
                t = wp.max(
                    t + (norm - wp.float64(1.0)) * norm * norm / wp.max(slope, wp.float64(1.0e-30)),
                    wp.float64(-0.999999) * wp.min(s2),
                )
            return t * wp.length(wp.vec3d(v[0] / (s2[0] + t), v[1] / (s2[1] + t), v[2] / (s2[2] + t)))

        return ellipsoid_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the ellipsoid, cut off at ``height`` [mm]."""
        from trimesh.creation import icosphere

        unit_sphere = icosphere(subdivisions=5)
        unit_sphere.apply_scale([self.a, self.b, self.c])
        unit_sphere.apply_translation([0.0, 0.0, self.c])
        return cut(unit_sphere, height)
