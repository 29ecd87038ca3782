"""A cone with a spherical tip on a round shank."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Self

import numpy as np

from tacdata.indenters.indenter import Indenter, warp

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function


@dataclass(frozen=True)
class Cone(Indenter):
    """A cone pointing down that widens to an upright shank; tip and shoulder share one rounding.

    The solid is the Minkowski sum of a sharp cone on a shank (narrower by the tip radius) and a ball.
    """

    half_angle: float
    """Angle between the axis and the flank [deg], below 90."""
    tip_radius: float
    """Radius of the tip and of the shoulder where the flank meets the shank [mm], below `radius`."""
    radius: float
    """Radius of the shank [mm]."""

    def __post_init__(self) -> None:
        """Refuse angles that make no cone and tips wider than the shank.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.half_angle >= 90:
            self._refuse("half_angle", "less than 90 deg (a flat punch has its own file)")
        if self.tip_radius >= self.radius:
            self._refuse("tip_radius", f"less than radius = {self.radius:g} mm")

    @classmethod
    def example(cls) -> Self:
        """Return a blunt 90 degree cone on a shank of 6 mm diameter."""
        return cls(half_angle=45.0, tip_radius=0.5, radius=3.0)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The half angle [rad], tip radius and shank radius [mm]."""
        return (float(np.radians(self.half_angle)), self.tip_radius, self.radius)

    @property
    def extent(self) -> float:
        """The shank's radius [mm]."""
        return self.radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the lower height [mm] of tip, flank and shoulder at r = |(x, y)|."""
        angle, tip, radius = self.parameters
        return wedge_height(np.hypot(x, y), angle, tip, radius)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance of the sharp cone on its shank, less the tip radius, in (r, z)."""
        wp = warp()

        wedge = wedge_distance()

        @wp.func
        def cone_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            return wedge(wp.length(wp.vec2d(p[0], p[1])), p[2] - q[1], q[0], q[2] - q[1]) - q[1]

        return cone_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return tip, flank and shank up to ``height`` [mm]."""
        from trimesh.creation import revolve

        # Square-root spacing at the rim: the profile is vertical there.
        r = self.radius * np.sin(np.linspace(0.0, np.pi / 2, 129))
        z = wedge_height(r, *self.parameters)
        low = z < height
        rim = np.interp(height, z, r)
        line = np.vstack([np.stack([r[low], z[low]], axis=-1), [[rim, height], [0.0, height]]])
        return revolve(line, sections=96)


@cache
def wedge_distance() -> Function:
    """Return a Warp function ``f(r, h, angle, reach)``: the distance [mm] to a sharp wedge on a shank.

    In the half-plane r >= 0 the wedge has its tip at (0, 0) and a flank at ``angle`` [rad] from the axis,
    which becomes upright at r = ``reach`` [mm].
    """
    wp = warp()

    @wp.func
    def wedge(r: wp.float64, h: wp.float64, angle: wp.float64, reach: wp.float64):
        zero = wp.float64(0.0)
        c = wp.cos(angle)
        s = wp.sin(angle)
        normal_distance = r * c - h * s
        flank_distance = r * s + h * c
        shank_distance = r - reach
        past = flank_distance - wp.clamp(flank_distance, zero, reach / s)
        below = wp.min(h - reach * c / s, zero)
        outside = wp.min(wp.length(wp.vec2d(normal_distance, past)), wp.length(wp.vec2d(shank_distance, below)))
        return wp.where(
            wp.max(normal_distance, shank_distance) <= zero, wp.max(normal_distance, shank_distance), outside
        )

    return wedge


def wedge_height(r: np.ndarray, angle: float, tip: np.ndarray | float, reach: np.ndarray | float) -> np.ndarray:
    """Return the lower height [mm] over r [mm] of a wedge rounded by ``tip`` [mm], as wide as ``reach`` [mm].

    The lowest point has height 0; ``inf`` beyond the reach. Arrays are broadcast.
    """
    c, s = np.cos(angle), np.sin(angle)
    shoulder = reach - tip
    ball = tip - np.sqrt(np.maximum(tip**2 - r**2, 0.0))
    flank = tip + (r * c - tip) / s
    bend = tip + shoulder * c / s - np.sqrt(np.maximum(tip**2 - (r - shoulder) ** 2, 0.0))
    height = np.where(r <= tip * c, ball, np.where(r <= shoulder + tip * c, flank, bend))
    return np.where(r <= reach, height, np.inf)
