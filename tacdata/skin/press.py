"""One press: an indenter goes down to a depth and comes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.indenters import Indenter


@dataclass(frozen=True)
class PressRequest:
    """One press: an indenter goes down to a depth and comes back.

    Example:
        >>> from tacdata.indenters.sphere import Sphere
        >>> from tacdata.skin.press import PressRequest
        >>> press = PressRequest(Sphere(4.0), x=0.0, y=0.0, yaw=0.0, depths=(0.0, 0.5, 1.0, 0.5, 0.0))
        >>> press.steps(longest=0.25)  # load steps
        8.0
    """

    indenter: Indenter
    """The indenter."""
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
