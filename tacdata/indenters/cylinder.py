"""A lying cylinder (a pin) with filleted ends."""

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
class Cylinder(Indenter):
    """A cylinder lying along x that touches with a line; its two end edges are filleted."""

    radius: float
    """Radius [mm]."""
    length: float
    """Length from end to end [mm]."""
    edge_radius: float
    """Radius of the fillet at the ends [mm], at most `radius` (spherical ends) and half the length."""

    def __post_init__(self) -> None:
        """Refuse a fillet that the ends have no room for.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.edge_radius > min(self.radius, self.length / 2):
            self._refuse("edge_radius", f"at most {min(self.radius, self.length / 2):g} mm")

    @classmethod
    def example(cls) -> Self:
        """Return a pin of 3 mm diameter and 6 mm length."""
        return cls(radius=1.5, length=6.0, edge_radius=0.4)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The radius, length and edge radius [mm]."""
        return (self.radius, self.length, self.edge_radius)

    @property
    def extent(self) -> float:
        """Distance [mm] of the end corners (before rounding, an upper bound) from the vertical axis."""
        return float(np.hypot(self.length / 2, self.radius))

    @property
    def height(self) -> float:
        """The diameter [mm]."""
        return 2 * self.radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return R - sqrt(s^2 - y^2) [mm], s the section's radius at x: R, less in the fillets."""
        e = self.edge_radius
        excess = np.maximum(np.abs(x) - (self.length / 2 - e), 0.0)
        section = self.radius - e + np.sqrt(np.maximum(e**2 - excess**2, 0.0))
        inside = section**2 - y**2
        return np.where((excess <= e) & (inside >= 0), self.radius - np.sqrt(np.maximum(inside, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance of the cylinder shrunk by the fillet, less the fillet, in (x, rho)."""
        wp = warp()

        @wp.func
        def cylinder_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            zero = wp.float64(0.0)
            u = wp.abs(p[0]) - (wp.float64(0.5) * q[1] - q[2])
            v = wp.length(wp.vec2d(p[1], p[2] - q[0])) - (q[0] - q[2])
            return wp.min(wp.max(u, v), zero) + wp.length(wp.vec2d(wp.max(u, zero), wp.max(v, zero))) - q[2]

        return cylinder_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the cylinder, cut off at ``height`` [mm]."""
        import trimesh

        e = self.edge_radius
        angle = np.linspace(0.0, np.pi / 2, 13)
        end = e * np.stack([np.sin(angle), np.cos(angle)], axis=-1) + [self.radius - e, self.length / 2 - e]
        rho, x = np.vstack([end, end[::-1] * [1, -1]]).T
        turn = np.linspace(0.0, 2 * np.pi, 96, endpoint=False)[:, None]
        points = np.stack(
            [np.broadcast_to(x, (96, len(x))), rho * np.sin(turn), self.radius - rho * np.cos(turn)], axis=-1
        )
        hull = trimesh.convex.convex_hull(points.reshape(-1, 3))
        return cut(hull, height)
