"""One press: an indenter goes down to a depth and comes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import SolveError
from tacdata.indenters import Indenter
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class PressRequest:
    """One press: an indenter goes down to a depth and comes back."""

    indenter: Indenter
    """What presses."""
    x: float
    """Place of its lowest point [mm]."""
    y: float
    """Place of its lowest point [mm]."""
    yaw: float
    """Rotation about z [deg]."""
    depths: tuple[float, ...]
    """Depths of the states to report [mm]: 0, rising to the deepest, then falling to 0 (or ending at the deepest)."""

    def check(self, sensor: Sensor) -> None:
        """Refuse a press that misses the skin or goes through it.

        Raises:
            SolveError: Saying which.
        """
        skin = sensor.skin
        if not self.depths or not np.all(np.isfinite(self.depths)) or min(self.depths) < 0:
            raise SolveError(f"depths {self.depths} mm", "one or more depths of 0 mm or more", "correct the press")
        if max(self.depths) >= skin.thickness:
            raise SolveError(
                f"depth {max(self.depths):g} mm in a skin {skin.thickness:g} mm thick",
                f"less than {skin.thickness:g} mm", "reduce the depth",
            )
        if not np.all(np.isfinite([self.x, self.y, self.yaw])):
            raise SolveError(
                f"press at ({self.x}, {self.y}) mm, yaw {self.yaw} deg", "finite numbers", "correct the press"
            )
        if abs(self.x) > skin.size_x / 2 or abs(self.y) > skin.size_y / 2:
            raise SolveError(
                f"press at ({self.x:g}, {self.y:g}) mm, the skin spans {skin.size_x:g} x {skin.size_y:g} mm",
                "a place on the skin", "move the press",
            )
        reach = self.indenter.footprint(max(self.depths), self.yaw)
        over = [abs(place) + half - size / 2 for place, half, size in
                zip((self.x, self.y), reach, (skin.size_x, skin.size_y), strict=True)]
        if "sides" in sensor.contact.bonded and max(over) > 0 and max(self.depths) > 0:
            raise SolveError(
                f"{self.indenter.shape} at ({self.x:g}, {self.y:g}) mm, {max(self.depths):g} mm deep, reaches "
                f"{max(over):.2f} mm over the rim, which is bonded to the frame",
                f"a footprint of {reach[0]:.2f} x {reach[1]:.2f} mm around the press inside the rim",
                "move the press inward, press less deep, or describe another bonding in the sensor file",
            )
