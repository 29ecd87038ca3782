"""Rotation of the sensor against the guide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Rotation(Effect):
    """Rotation of the sensor against the guide."""

    title = "Rotation of the sensor against the guide"
    catalogue = ("K2",)
    stage = "kinematics"
    moves = ("label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    equation = "(x, y) -> (x cos theta - y sin theta, y cos theta + x sin theta)"
    source = "standard form"
    experiment = "presses far from the centre at all four corners"
    form_error = 0.02
    parameters = (Parameter("theta", "rad", "turn about z", 0.02, -0.3, 0.3),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        x, y, depth = state.pose.T
        along, across = np.cos(values["theta"]), np.sin(values["theta"])
        return replace(state, pose=np.stack([along * x - across * y, along * y + across * x, depth], axis=-1))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
