"""From pressures at nodes of the protrusions to a map of each: pressure on the board, seen from above."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.sensor.protrusion_pixels import PIXELS, ProtrusionPixels
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.point_forces import PointForces, cloud_in_cell


class ProtrusionRaster:
    """The protrusions of one mesh over their pixels; costs milliseconds to build."""

    def __init__(self, mesh: SkinMesh, sensor: Sensor) -> None:
        """Bind pixels to a mesh."""
        self._taxel, self._centers = mesh.protrusion_taxel, sensor.taxels.centers
        self._pixels = ProtrusionPixels(sensor.skin.protrusion_radius)
        self._forces = PointForces(mesh.nodes, mesh.protrusions)

    def pressure(self, u: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Return the force by area of the map [MPa], shape (taxels, PIXELS, PIXELS).

        Points off a protrusion's pixels count at their border, so that the map sums to the protrusion's load.

        Args:
            u: Nodal displacements [mm], shape (nodes, 3).
            pressure: At the nodes of the protrusions, ascending, by undeformed area [MPa], shape (s,).
        """
        face, places, force = self._forces.at(u, pressure[:, None])
        taxel = self._taxel[face]
        place = (places - self._centers[taxel] - self._pixels.offsets[0]) / self._pixels.pitch
        # The maps lie below each other; at the last centre of one all of a force falls to it.
        place = place.clip(0, PIXELS - 1) + PIXELS * np.stack([taxel, 0 * taxel], axis=-1)
        maps = cloud_in_cell(place, force, (PIXELS * len(self._centers), PIXELS))
        return maps.reshape(len(self._centers), PIXELS, PIXELS) / self._pixels.pitch**2
