"""From contact tractions at nodes of the outer face to a map: force by area, seen from above like the depth map.

Each quadrature point of a face carries its traction times its area to where it lies now, seen from above. Its force is
shared among the four pixels around it by bilinear weights (cloud in cell). So nothing is lost or made: the map times
the area of a pixel sums to the force, but for what lies off the grid.
"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import DepthMap
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh

_SUBDIVISIONS = 4
"""Sub-triangles along an edge of a face: points lie denser than pixels, or the map is grainy."""


class TractionRaster:
    """The outer face of one mesh over a sensor's pixels; costs milliseconds to build."""

    def __init__(self, mesh: SkinMesh, pixels: DepthMap) -> None:
        """Bind pixels to a mesh."""
        self._faces, self._pixels = mesh.outer, pixels
        points, weights = elements.triangle_quadrature(_SUBDIVISIONS)
        self._nodes = mesh.nodes
        self._shapes, self._hats = elements.triangle_shapes(points), elements.triangle_hats(points)
        tangents = np.einsum("fai,kaj->fkij", mesh.nodes[mesh.outer], elements.triangle_gradients(points))
        normals = np.cross(tangents[..., 0], tangents[..., 1])
        self._area = np.linalg.norm(normals, axis=-1) * weights
        contact, slots = np.unique(mesh.outer, return_inverse=True)
        self.count = len(contact)
        """Number of contact nodes: those of the outer face, ascending."""
        self.slots = slots.reshape(mesh.outer.shape)
        """Contact nodes of each face of the outer face, shape (f, 6)."""

    def traction(self, u: np.ndarray, traction: np.ndarray) -> np.ndarray:
        """Return the force by area of the map [MPa], shape (3, pixels_x, pixels_y).

        Args:
            u: Nodal displacements [mm], shape (nodes, 3).
            traction: At the contact nodes, by undeformed area [MPa], shape (count, 3).
        """
        nx, ny = self._pixels.shape
        pitch, result = self._pixels.pixel_pitch, np.zeros((3, nx * ny))
        touching = np.flatnonzero((traction != 0).any(axis=1)[self.slots].any(axis=1))
        faces = self._faces[touching]
        here = (self._shapes @ (self._nodes[faces] + u[faces])[:, :, :2]).reshape(-1, 2)
        force = self._hats @ traction[self.slots[touching]]
        force = (force * self._area[touching][..., None]).reshape(-1, 3)
        place = (here - np.array([self._pixels.x[0], self._pixels.y[0]])) / pitch
        corner = np.floor(place).astype(int)
        part = place - corner
        for i in (0, 1):
            for j in (0, 1):
                share = np.abs(1 - i - part[:, 0]) * np.abs(1 - j - part[:, 1])
                column, row = (corner + np.array([i, j])).T
                on = (column >= 0) & (column < nx) & (row >= 0) & (row < ny)
                pixel = column[on] * ny + row[on]
                for axis in range(3):
                    result[axis] += np.bincount(pixel, share[on] * force[on, axis], nx * ny)
        return result.reshape(3, nx, ny) / pitch**2
