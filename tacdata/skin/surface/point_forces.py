"""Contact tractions at nodes as forces at points of the deformed faces, and forces at points as a map.

Each quadrature point of a face carries its traction times its area to its deformed place, seen from above. Its force is
shared among the four pixels around it by bilinear weights (cloud in cell). So nothing is lost or made: the map times
the area of a pixel sums to the force, except for points off the grid.
"""

from __future__ import annotations

import numpy as np

from tacdata.skin.mesh import elements

_SUBDIVISIONS = 4
"""Sub-triangles along an edge of a face: points lie denser than pixels, or the map is grainy."""


class PointForces:
    """Faces of one mesh and the points on them; costs milliseconds to build."""

    def __init__(self, nodes: np.ndarray, faces: np.ndarray) -> None:
        """Bind faces, shape (f, 6), of the mesh's nodes [mm], shape (n, 3)."""
        self._nodes, self._faces = nodes, faces
        points, weights = elements.triangle_quadrature(_SUBDIVISIONS)
        self._shapes, self._hats = elements.triangle_shapes(points), elements.triangle_hats(points)
        tangents = np.einsum("fai,kaj->fkij", nodes[faces], elements.triangle_gradients(points))
        normals = np.cross(tangents[..., 0], tangents[..., 1])
        self._area = np.linalg.norm(normals, axis=-1) * weights
        contact, slots = np.unique(faces, return_inverse=True)
        self.count = len(contact)
        """Number of contact nodes: those of the faces, ascending."""
        self.slots = slots.reshape(faces.shape)
        """Contact nodes of each face, shape (f, 6)."""

    def at(self, u: np.ndarray, traction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the points of faces that carry anything: their face, their place and their force.

        Args:
            u: Nodal displacements [mm], shape (n, 3).
            traction: At the contact nodes, by undeformed area [MPa], shape (count, c).

        Returns:
            Index of the face, shape (p,); x and y now [mm], shape (p, 2); force [N], shape (p, c).
        """
        touching = np.flatnonzero((traction != 0).any(axis=1)[self.slots].any(axis=1))
        faces = self._faces[touching]
        places = (self._shapes @ (self._nodes[faces] + u[faces])[:, :, :2]).reshape(-1, 2)
        force = (self._hats @ traction[self.slots[touching]]) * self._area[touching][..., None]
        return np.repeat(touching, len(self._shapes)), places, force.reshape(len(places), traction.shape[1])


def cloud_in_cell(place: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Share values at points among pixels.

    Args:
        place: From the centre of pixel [0, 0] [px], shape (p, 2).
        values: At the points, shape (p, c).
        shape: Pixels of the map.

    Returns:
        The sums, shape (c, rows, columns); points off the map are left out.
    """
    rows, columns = shape
    result = np.zeros((values.shape[1], rows * columns))
    corner = np.floor(place).astype(int)
    part = place - corner
    for i in (0, 1):
        for j in (0, 1):
            share = np.abs(1 - i - part[:, 0]) * np.abs(1 - j - part[:, 1])
            row, column = (corner + np.array([i, j])).T
            on = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            pixel = row[on] * columns + column[on]
            for axis, component in enumerate(values.T):
                result[axis] += np.bincount(pixel, share[on] * component[on], rows * columns)
    return result.reshape(len(result), rows, columns)
