"""A ring (torus) lying flat."""

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
class Ring(Indenter):
    """A torus whose axis is z; it touches with a circle around the origin, and has a hole there."""

    ring_radius: float
    """Radius of the circle that the tube's centre runs on [mm]."""
    tube_radius: float
    """Radius of the tube [mm], below `ring_radius`."""

    def __post_init__(self) -> None:
        """Refuse a tube that would fill the hole.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.tube_radius >= self.ring_radius:
            self._refuse("tube_radius", f"less than ring_radius = {self.ring_radius:g} mm")

    @classmethod
    def example(cls) -> Self:
        """Return a ring of 5 mm mean diameter."""
        return cls(ring_radius=2.5, tube_radius=0.8)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The ring radius and the tube radius [mm]."""
        return (self.ring_radius, self.tube_radius)

    @property
    def extent(self) -> float:
        """The outer radius [mm]."""
        return self.ring_radius + self.tube_radius

    @property
    def height(self) -> float:
        """The diameter of the tube [mm]."""
        return 2 * self.tube_radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return t - sqrt(t^2 - (r - R)^2) [mm]; ``inf`` in the hole too."""
        t = self.tube_radius
        inside = t**2 - (np.hypot(x, y) - self.ring_radius) ** 2
        return np.where(inside >= 0, t - np.sqrt(np.maximum(inside, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return |(r - R, z - t)| - t."""
        wp = warp()

        @wp.func
        def ring_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            return wp.length(wp.vec2d(wp.length(wp.vec2d(p[0], p[1])) - q[0], p[2] - q[1])) - q[1]

        return ring_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the torus, cut off at ``height`` [mm]."""
        from trimesh.creation import revolve

        t = self.tube_radius
        span = np.arccos(max(1 - height / t, -1.0))
        angle = np.linspace(-span, span, 49)
        line = np.stack([self.ring_radius + t * np.sin(angle), t * (1 - np.cos(angle))], axis=-1)
        line[-1] = line[0] if span == np.pi else line[-1]
        return revolve(line if span == np.pi else np.vstack([line, line[:1]]), sections=96)
