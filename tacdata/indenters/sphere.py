"""A sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tacdata.indenters.indenter import Indenter

if TYPE_CHECKING:
    import warp as wp


@dataclass(frozen=True)
class Sphere(Indenter):
    """A sphere that touches with its lowest point."""

    radius: float
    """Radius [mm]."""

    @property
    def parameters(self) -> tuple[float, ...]:
        """The radius [mm]."""
        return (self.radius,)

    @property
    def extent(self) -> float:
        """The radius [mm]."""
        return self.radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return R - sqrt(R^2 - r^2) [mm]."""
        inside = self.radius**2 - x**2 - y**2
        return np.where(inside >= 0, self.radius - np.sqrt(np.maximum(inside, 0.0)), np.inf)

    def distance_function(self) -> wp.Function:
        """Return |p - c| - R with the centre at (0, 0, R)."""
        import warp as wp

        @wp.func
        def sphere_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):  # type: ignore[valid-type]
            return wp.length(p - wp.vec3d(wp.float64(0.0), wp.float64(0.0), q[0])) - q[0]

        return sphere_distance
