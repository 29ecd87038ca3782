"""From contact tractions at nodes of the outer face to a map: force by area, seen from above like the depth map."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import DepthMap
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.point_forces import PointForces, cloud_in_cell


class TractionRaster:
    """The outer face of one mesh over a sensor's pixels; costs milliseconds to build."""

    def __init__(self, mesh: SkinMesh, pixels: DepthMap) -> None:
        """Bind pixels to a mesh."""
        self._pixels, self._forces = pixels, PointForces(mesh.nodes, mesh.outer)
        self.slots = self._forces.slots
        """Contact nodes of each face of the outer face, shape (f, 6)."""
        self.count = self._forces.count
        """Number of contact nodes: those of the outer face, ascending."""

    def traction(self, u: np.ndarray, traction: np.ndarray) -> np.ndarray:
        """Return the force by area of the map [MPa], shape (3, pixels_x, pixels_y).

        Args:
            u: Nodal displacements [mm], shape (nodes, 3).
            traction: At the contact nodes, by undeformed area [MPa], shape (count, 3).
        """
        pitch = self._pixels.pixel_pitch
        _, places, force = self._forces.at(u, traction)
        place = (places - np.array([self._pixels.x[0], self._pixels.y[0]])) / pitch
        return cloud_in_cell(place, force, self._pixels.shape) / pitch**2
