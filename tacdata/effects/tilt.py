"""The skin's face is not parallel to the guide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Tilt(Effect):
    """The skin's face is not parallel to the guide."""

    title = "The skin's face is not parallel to the guide"
    catalogue = ("K3",)
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + a x + b y"
    source = "standard form"
    experiment = "touch off at three corners"
    form_error = 0.02
    parameters = (
        Parameter("a", "mm/mm", "slope along x", 0.01, -0.2, 0.2),
        Parameter("b", "mm/mm", "slope along y", 0.01, -0.2, 0.2),
    )

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        x, y, depth = state.pose.T
        return replace(state, pose=np.stack([x, y, depth + values["a"] * x + values["b"] * y], axis=-1))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
