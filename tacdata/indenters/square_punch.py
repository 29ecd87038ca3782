"""A square punch with rounded edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Self

import numpy as np

from tacdata.indenters.indenter import Indenter, rounded_hull, warp

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function


@dataclass(frozen=True)
class SquarePunch(Indenter):
    """An upright square column, flat below, sides along x and y; lower and vertical edges rounded equally."""

    side: float
    """Width from face to face [mm]."""
    edge_radius: float
    """Radius of the edges [mm], at most half the side."""

    def __post_init__(self) -> None:
        """Refuse an edge radius that the side has no room for.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.edge_radius > self.side / 2:
            self._refuse("edge_radius", f"at most half the side = {self.side / 2:g} mm")

    @classmethod
    def example(cls) -> Self:
        """Return a punch 4 mm wide."""
        return cls(side=4.0, edge_radius=0.3)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The side and the edge radius [mm]."""
        return (self.side, self.edge_radius)

    @property
    def extent(self) -> float:
        """Distance [mm] of the rounded vertical edges from the axis."""
        return float(np.sqrt(2.0) * (self.side / 2 - self.edge_radius) + self.edge_radius)

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return 0 under the flat and a circle under the rounded edges and corners [mm]."""
        e, flat = self.edge_radius, self.side / 2 - self.edge_radius
        excess = np.hypot(np.maximum(np.abs(x) - flat, 0.0), np.maximum(np.abs(y) - flat, 0.0))
        return np.where(excess <= e, e - np.sqrt(np.maximum(e**2 - excess**2, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance of the column shrunk by the edge radius, less that radius."""
        wp = warp()

        @wp.func
        def square_punch_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            zero = wp.float64(0.0)
            flat = wp.float64(0.5) * q[0] - q[1]
            u = wp.abs(p[0]) - flat
            v = wp.abs(p[1]) - flat
            w = q[1] - p[2]
            outside = wp.length(wp.vec3d(wp.max(u, zero), wp.max(v, zero), wp.max(w, zero)))
            return wp.min(wp.max(u, wp.max(v, w)), zero) + outside - q[1]

        return square_punch_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the column up to ``height`` [mm]."""
        e, flat = self.edge_radius, self.side / 2 - self.edge_radius
        corners = np.array([(x, y, z) for x in (-flat, flat) for y in (-flat, flat) for z in (e, height + e)])
        return rounded_hull(corners, e, height)
