"""A flat-ended round punch with a filleted edge."""

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
class FlatPunch(Indenter):
    """An upright round column, flat below; the fillet rounds the lower edge."""

    radius: float
    """Radius of the column [mm]."""
    edge_radius: float
    """Radius of the fillet [mm], at most `radius` (a hemispherical end)."""

    def __post_init__(self) -> None:
        """Refuse a fillet wider than the column.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.edge_radius > self.radius:
            self._refuse("edge_radius", f"at most radius = {self.radius:g} mm")

    @classmethod
    def example(cls) -> Self:
        """Return a punch of 4 mm diameter."""
        return cls(radius=2.0, edge_radius=0.3)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The radius and the edge radius [mm]."""
        return (self.radius, self.edge_radius)

    @property
    def extent(self) -> float:
        """The radius [mm]."""
        return self.radius

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return 0 under the flat and a quarter circle under the fillet [mm]."""
        e = self.edge_radius
        excess = np.maximum(np.hypot(x, y) - (self.radius - e), 0.0)
        return np.where(excess <= e, e - np.sqrt(np.maximum(e**2 - excess**2, 0.0)), np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance of the column shrunk by the fillet, less the fillet, in (r, z)."""
        wp = warp()

        @wp.func
        def flat_punch_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            zero = wp.float64(0.0)
            u = wp.length(wp.vec2d(p[0], p[1])) - (q[0] - q[1])
            v = q[1] - p[2]
            return wp.min(wp.max(u, v), zero) + wp.length(wp.vec2d(wp.max(u, zero), wp.max(v, zero))) - q[1]

        return flat_punch_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the column up to ``height`` [mm]."""
        from trimesh.creation import revolve

        e = self.edge_radius
        angle = np.linspace(0.0, np.arccos(max(1 - height / e, 0.0)), 17)
        fillet = np.stack([self.radius - e + e * np.sin(angle), e * (1 - np.cos(angle))], axis=-1)
        column = [[self.radius, height]] if height > e else []
        line = np.array([[0.0, 0.0], *fillet[fillet[:, 0] > 0], *column, [0.0, height]])
        return revolve(line, sections=96)
