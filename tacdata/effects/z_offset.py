"""Error of the depth zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class ZOffset(Effect):
    """Error of the depth zero."""

    title = "Error of the depth zero"
    catalogue = ("K4",)
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz"
    source = "standard form"
    experiment = (
        "slow approaches at three corners and the centre: a constant onset error is dz, a plane is tilt, one "
        "per channel an air gap"
    )
    form_error = 0.02
    parameters = (Parameter("dz", "mm", "deeper than commanded", 0.05, -1.0, 1.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        pose = state.pose + np.array([0.0, 0.0, 1.0]) * values["dz"]
        return replace(state, pose=pose)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
