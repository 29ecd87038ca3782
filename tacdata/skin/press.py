"""One press: an indenter goes down to a depth and comes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import SolveError
from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.touch import reach, room

_STEEPEST = 30.0
"""Largest tilt [deg]; beyond, the depth of the lowest point says little of a press."""


@dataclass(frozen=True)
class PressRequest:
    """One press: an indenter goes down to a depth and comes back."""

    indenter: Indenter
    """What presses."""
    x: float
    """Place of its origin, which is its lowest point when upright [mm]."""
    y: float
    """Place of its origin [mm]."""
    yaw: float
    """Rotation about its own axis [deg]."""
    depths: tuple[float, ...]
    """Depths of the states to report [mm]: 0, rising to the deepest, then falling to 0 (or ending at the deepest);
    below 0, above the face, only where the skin sticks.

    Counted from the undeformed face at (x, y) to the lowest point of the indenter as it is turned."""
    tilt_x: float = 0.0
    """How far its axis leans about the sensor's x [deg], after the yaw and the tilt about y."""
    tilt_y: float = 0.0
    """How far its axis leans about the sensor's y [deg], after the yaw."""

    def steps(self, longest: float) -> float:
        """Return about how many load steps of at most ``longest`` [mm] the press takes."""
        return float(np.ceil(np.abs(np.diff(self.depths, prepend=0.0)) / longest).sum())

    def check(self, sensor: Sensor) -> None:
        """Refuse a press that misses the skin or goes through it.

        Raises:
            SolveError: Saying which.
        """
        skin = sensor.skin
        if not self.depths or not np.all(np.isfinite(self.depths)):
            raise SolveError(f"depths {self.depths} mm", "one or more depths of 0 mm or more", "correct the press")
        if min(self.depths) < 0 and sensor.contact.adhesion is None:
            raise SolveError(
                f"a depth of {min(self.depths):g} mm, above a skin that does not stick", "0 mm or more",
                "correct the press, or state contact/adhesion in the sensor file",
            )
        angles = f"yaw {self.yaw} deg, tilts {self.tilt_x} and {self.tilt_y} deg"
        if not np.all(np.isfinite([self.x, self.y, self.yaw, self.tilt_x, self.tilt_y])):
            raise SolveError(f"press at ({self.x}, {self.y}) mm, {angles}", "finite numbers", "correct the press")
        if max(abs(self.tilt_x), abs(self.tilt_y)) > _STEEPEST:
            raise SolveError(f"a press with {angles}", f"tilts of at most {_STEEPEST:g} deg", "reduce the tilt")
        if abs(self.x) > skin.size_x / 2 or abs(self.y) > skin.size_y / 2:
            raise SolveError(
                f"press at ({self.x:g}, {self.y:g}) mm, the skin spans {skin.size_x:g} x {skin.size_y:g} mm",
                "a place on the skin", "move the press",
            )
        thick = room(sensor, self)
        if max(self.depths) >= thick:
            raise SolveError(
                f"depth {max(self.depths):g} mm in a skin {thick:.3g} mm thick at ({self.x:g}, {self.y:g}) mm",
                f"less than {thick:.3g} mm", "reduce the depth",
            )
        half_x, half_y = reach(sensor, self)
        over = [abs(place) + half - size / 2 for place, half, size in
                zip((self.x, self.y), (half_x, half_y), (skin.size_x, skin.size_y), strict=True)]
        if "sides" in sensor.contact.bonded and max(over) > 0 and max(self.depths) > 0:
            raise SolveError(
                f"{self.indenter.shape} at ({self.x:g}, {self.y:g}) mm, {max(self.depths):g} mm deep, reaches "
                f"{max(over):.2f} mm over the rim, which is bonded to the frame",
                f"a footprint of {half_x:.2f} x {half_y:.2f} mm around the press inside the rim",
                "move the press inward, press less deep, or describe another bonding in the sensor file",
            )
