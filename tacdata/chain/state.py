"""State of every row at a stage of the chain."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tacdata.chain.course import Course
from tacdata.chain.response import Response

STAGES = ("kinematics", "view", "mechanics", "contact", "taxel", "readout", "timing", "simulator")
"""In the order in which they act. A view is the tip as a second observer sees it; errors of the simulator act last."""


@dataclass(frozen=True)
class State:
    """A course on its way through the chain. Effects return a changed copy."""

    course: Course
    response: Response
    pose: np.ndarray
    """x, y, depth of the true tip [mm], shape (n, 3)."""
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

    @property
    def loads(self) -> np.ndarray:
        """Loads on the channels and, last, the force on the indenter, shape (n, channels + 1)."""
        return np.column_stack([self.load, self.force])

    @cached_property
    def idle(self) -> np.ndarray:
        """Readings without contact, shape (1, channels)."""
        return self.response.signal(np.zeros_like(self.load[:1]))

    @property
    def rise(self) -> np.ndarray:
        """Readings above those without contact, shape (n, channels)."""
        return self.signal - self.idle

    def deeper(self, by: np.ndarray) -> State:
        """Return the state with a tip that is deeper by some amounts [mm], 0-d or of shape (n,)."""
        return replace(self, pose=self.pose + np.array([0.0, 0.0, 1.0]) * np.reshape(by, (-1, 1)))

    def scaled(self, factor: np.ndarray) -> State:
        """Return the state with loads and force multiplied by a factor [1], 0-d or of shape (n,)."""
        return replace(self, load=self.load * np.reshape(factor, (-1, 1)), force=self.force * factor)

    def with_loads(self, loads: np.ndarray) -> State:
        """Return the state with other loads and force, ordered as `loads`."""
        return replace(self, load=loads[:, :-1], force=loads[:, -1])

    def with_rise(self, rise: np.ndarray) -> State:
        """Return the state with other readings, stated above those without contact, shape (n, channels)."""
        return replace(self, signal=self.idle + rise)

    def with_pose(self, pose: np.ndarray) -> State:
        """Return the state with another tip, x, y, depth [mm], shape (n, 3)."""
        return replace(self, pose=pose)

    def with_signal(self, signal: np.ndarray) -> State:
        """Return the state with other readings, shape (n, channels)."""
        return replace(self, signal=signal)
