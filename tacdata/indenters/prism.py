"""A lying prism: a straight edge pointing down."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Self

import numpy as np

from tacdata.indenters.cone import wedge_distance, wedge_height
from tacdata.indenters.indenter import Indenter, rounded_hull, warp

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function


@dataclass(frozen=True)
class Prism(Indenter):
    """A triangular prism lying along x, one edge down, that widens to an upright shank of stated width.

    The solid is the Minkowski sum of a sharp prism (narrower and shorter by the edge radius on each side)
    and a ball, so every edge carries the same rounding.
    """

    angle: float
    """Included angle at the lower edge [deg], below 180."""
    edge_radius: float
    """Radius of all edges [mm], below half of `width` and at most half of `length`."""
    length: float
    """Length along x [mm], from end to end."""
    width: float
    """Width along y [mm] of the shank."""

    def __post_init__(self) -> None:
        """Refuse angles that make no edge and roundings without room.

        Raises:
            FormatError: If so, or if a parameter is not positive.
        """
        super().__post_init__()
        if self.angle >= 180:
            self._refuse("angle", "less than 180 deg (a square punch has its own file)")
        if self.edge_radius >= self.width / 2 or self.edge_radius > self.length / 2:
            allowed = f"below width / 2 = {self.width / 2:g} mm, at most length / 2 = {self.length / 2:g} mm"
            self._refuse("edge_radius", allowed)

    @classmethod
    def example(cls) -> Self:
        """Return a right-angled edge 6 mm long."""
        return cls(angle=90.0, edge_radius=0.3, length=6.0, width=5.0)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Half of the angle [rad], edge radius, length and half width [mm]."""
        return (float(np.radians(self.angle) / 2), self.edge_radius, self.length, self.width / 2)

    @property
    def extent(self) -> float:
        """Distance [mm] of the corners (before rounding, an upper bound) from the axis."""
        return float(np.hypot(self.length / 2, self.width / 2))

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the lower height [mm]: in the rounded ends a smaller ball takes the edge radius' place."""
        angle, edge, length, half_width = self.parameters
        excess = np.maximum(np.abs(x) - (length / 2 - edge), 0.0)
        ball = np.sqrt(np.maximum(edge**2 - excess**2, 0.0))
        height = wedge_height(np.abs(y), angle, ball, half_width - edge + ball) + edge - ball
        return np.where(excess <= edge, height, np.inf)

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the distance of the sharp prism, less the edge radius."""
        wp = warp()

        wedge = wedge_distance()

        @wp.func
        def prism_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            zero = wp.float64(0.0)
            u = wp.abs(p[0]) - (wp.float64(0.5) * q[2] - q[1])
            v = wedge(wp.abs(p[1]), p[2] - q[1], q[0], q[3] - q[1])
            return wp.min(wp.max(u, v), zero) + wp.length(wp.vec2d(wp.max(u, zero), wp.max(v, zero))) - q[1]

        return prism_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return edge, flanks and shank up to ``height`` [mm]."""
        angle, edge, length, half_width = self.parameters
        x, y = length / 2 - edge, half_width - edge
        shoulder = edge + y / np.tan(angle)
        top = height + shoulder
        section = [(0.0, edge), (y, shoulder), (-y, shoulder), (y, top), (-y, top)]
        return rounded_hull(np.array([(s * x, v, z) for s in (-1, 1) for v, z in section]), edge, height)
