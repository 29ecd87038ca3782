"""The guide follows its command late."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import second_order
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class ServoLag(Effect):
    """The guide follows its command late."""

    title = "The guide follows its command late"
    catalogue = ("K15",)
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "lag of the drive"
    equation = "(tau / 2)^2 d'' + tau d' + d = z: critically damped"
    source = "standard form"
    experiment = "the same speed with other accelerations; a tag on the carriage sees a drive's lag"
    parameters = (Parameter("tau", "s", "time constant", 0.05, 0.0, 1.0),)
    at_rest = AtRest.CATCHES_UP
    seen_by_tag = True
    damping: ClassVar[float] = 1.0
    """Damping of the loop; 1 is critical [1]."""

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        tau = float(values["tau"])
        if tau <= 0.0:
            return state
        pose = state.pose.copy()
        way, step = pose[:, 2] - pose[0, 2], state.course.step
        pose[:, 2] = pose[0, 2] + second_order(way, step, tau, self.damping)
        return replace(state, pose=pose)
