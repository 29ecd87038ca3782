"""What is known of every row at a stage of the chain."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.chain.course import Course
from tacdata.chain.response import Response

STAGES = ("kinematics", "view", "mechanics", "contact", "taxel", "readout", "timing", "simulator")
"""In the order in which they act; a view is what a second observer makes of the tip, the simulator's own errors act
last."""


@dataclass(frozen=True)
class State:
    """A course on its way through the chain. Effects return a changed copy (`dataclasses.replace`)."""

    course: Course
    response: Response
    pose: np.ndarray
    """x, y, depth of the tip as it truly is [mm], shape (n, 3)."""
    load: np.ndarray
    """Load on each channel [the response's unit], shape (n, channels); empty in the kinematic stage."""
    force: np.ndarray
    """Normal force on the indenter [the response's unit], shape (n,); empty in the kinematic stage."""
    signal: np.ndarray
    """Readings [the source's unit], shape (n, channels); empty before the taxel stage."""
    view: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    """x, y, depth of the tip as a tag, or a gauge, sees it [mm], shape (n, 3); empty in the kinematic stage."""

    @property
    def depth(self) -> np.ndarray:
        """Depth of the tip [mm], shape (n,)."""
        return self.pose[:, 2]
