"""A sphere."""

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
class Sphere(Indenter):
    """A sphere that touches with its lowest point.

    Example:
        >>> from tacdata.indenters.sphere import Sphere
        >>> ball = Sphere(radius=4.0)
        >>> ball.document
        {'shape': 'sphere', 'radius': 4.0}
        >>> round(float(ball.profile(1.0, 0.0)), 3)  # height of its surface 1 mm off the axis, mm
        0.127
    """

    radius: float
    """Radius [mm]."""

    @classmethod
    def example(cls) -> Self:
        """Return a sphere of 4 mm diameter."""
        return cls(radius=2.0)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The radius [mm]."""
        return (self.radius,)

    @property
    def extent(self) -> float:
        """The radius [mm]."""
        return self.radius

    @property
    def height(self) -> float:
        """The diameter [mm]."""
        return 2 * self.radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return R - sqrt(R^2 - r^2) [mm]."""
        inside = self.radius**2 - x**2 - y**2
        return np.where(inside >= 0, self.radius - np.sqrt(np.maximum(inside, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return |p - c| - R with the centre at (0, 0, R)."""
        wp = warp()

        @wp.func
        def sphere_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            return wp.length(p - wp.vec3d(wp.float64(0.0), wp.float64(0.0), q[0])) - q[0]

        return sphere_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the sphere, cut off at ``height`` [mm]."""
        from trimesh.creation import revolve

        top = min(height, 2 * self.radius)
        angle = np.linspace(0.0, np.arccos(1 - top / self.radius), 49)
        line = np.stack([self.radius * np.sin(angle), self.radius * (1 - np.cos(angle))], axis=-1)
        line[0, 0] = 0.0
        if top < 2 * self.radius:
            line = np.vstack([line, [0.0, top]])
        else:
            # The sine of pi is not 0 in floating point, and `revolve` closes only what ends on the axis.
            line[-1, 0] = 0.0
        return revolve(line, sections=96)
