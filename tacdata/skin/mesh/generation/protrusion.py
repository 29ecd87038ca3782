"""The shape of one protrusion: a spherical cap, a hemisphere, or a cylinder with a hemispherical end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from tacdata.sensor import Skin

RINGS = ((30.0, 6, 0.0), (90.0, 8, 0.5))
"""Rings of vertices on a hemisphere: polar angle from the tip [deg], vertices, turn [vertices].

The inner ring encloses the contact patch. On a lower cap the angles shrink in proportion."""

_GROWTH = 1.5
"""Ratio of edge lengths from one ring to the next [1]."""


@dataclass(frozen=True)
class Protrusion:
    """One protrusion with its foot's centre at the origin, tip down."""

    radius: float
    """Radius of the foot [mm]."""
    height: float
    """How far the tip reaches below the foot [mm]; `radius` makes a hemisphere."""

    @classmethod
    def of(cls, skin: Skin) -> Protrusion:
        """Return the protrusion of a skin that has some."""
        return cls(skin.protrusion_radius, skin.protrusion_tip)

    @property
    def sphere(self) -> float:
        """Radius of the rounded end's sphere [mm]: (a^2 + h^2) / 2h of a cap of foot radius a and height h."""
        if self.height >= self.radius:
            return self.radius
        return (self.radius**2 + self.height**2) / (2 * self.height)

    @property
    def center(self) -> float:
        """Height of that sphere's centre [mm]; above 0 for a cap, below 0 under a cylinder."""
        return self.sphere - self.height

    @property
    def volume(self) -> float:
        """Volume below the foot [mm^3]."""
        a, h = self.radius, self.height
        if h >= a:
            return np.pi * a**2 * (h - a) + 2 / 3 * np.pi * a**3
        return np.pi * h * (3 * a**2 + h**2) / 6

    def project(self, offset: np.ndarray) -> np.ndarray:
        """Return points moved onto the surface, along the radius of the sphere or of the cylinder.

        Args:
            offset: Points relative to the foot's centre [mm], shape (n, 3).
        """
        axis = np.zeros_like(offset)
        # Above the sphere's centre is the cylinder, whose radius is horizontal.
        axis[:, 2] = np.where(offset[:, 2] > self.center, offset[:, 2], self.center)
        radial = offset - axis
        return axis + radial * (self.sphere / np.linalg.norm(radial, axis=1, keepdims=True))

    def away(self, offset: np.ndarray) -> np.ndarray:
        """Return the distance of points (n, 3) from the surface [mm], negative inside, shape (n,)."""
        z = np.minimum(offset[:, 2], 0.0)
        reach = np.hypot(np.hypot(offset[:, 0], offset[:, 1]), np.minimum(z - self.center, 0.0))
        return reach - self.sphere

    def rings(self, tip: float | None) -> tuple[tuple[float, int, float], ...]:
        """Return rings of vertices as in `RINGS`, for an edge length at the tip [mm] that grows away from it."""
        if tip is None:
            return RINGS
        rings: list[tuple[float, int, float]] = []
        polar, edge = 0.0, tip
        while polar < 90.0:
            polar += np.degrees(edge / self.sphere)
            # A remainder at the foot that would be a sliver joins the last ring.
            polar = 90.0 if polar + 0.5 * np.degrees(edge / self.sphere) > 90.0 else polar
            count = max(round(2 * np.pi * self.sphere * np.sin(np.radians(polar)) / edge), 6)
            # Every other ring is turned by half a vertex, so that triangles between rings are nearly equilateral.
            rings.append((float(polar), count, 0.5 * (len(rings) % 2)))
            # Contact with the board begins at the tip, so edges are shortest there.
            edge *= _GROWTH
        return tuple(rings)

    def hull(self, root: float, tip: float | None = None) -> trimesh.Trimesh:
        """Return a coarse closed surface, vertices on the true one, with a prism of height ``root`` [mm] above.

        Args:
            root: Height of the prism [mm].
            tip: Edge length at the tip [mm], as in `MeshSettings`.
        """
        points = [[0.0, 0.0, -self.height]]
        widest = np.arcsin(min(self.radius / self.sphere, 1.0))
        rings = self.rings(tip)
        count, turn = rings[-1][1:]
        for polar, number, start in rings:
            polar = polar / rings[-1][0] * widest
            wide, low = self.sphere * np.sin(polar), self.center - self.sphere * np.cos(polar)
            points += _ring(wide, low, number, start)
        if self.height > self.radius:
            points += _ring(self.radius, 0.0, count, turn)
        points += _ring(self.radius, root, count, turn)
        return trimesh.Trimesh(points).convex_hull


def _ring(radius: float, z: float, count: int, turn: float) -> list[list[float]]:
    angle = 2 * np.pi * (np.arange(count) + turn) / count
    return [[radius * np.cos(a), radius * np.sin(a), z] for a in angle]
