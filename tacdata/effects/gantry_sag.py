"""The guide's height changes over its bed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class GantrySag(Effect):
    """The guide's height changes over its bed."""

    title = "The guide's height changes over its bed"
    catalogue = ("K14",)
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + k (x^2 + y^2) / L^2, L the largest distance from the centre"
    source = "standard form"
    experiment = "move the sensor to another place on the bed: a sag stays with the machine"
    parameters = (Parameter("k", "mm", "height at the largest distance", 0.03, -0.5, 0.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        square = (state.pose[:, :2] ** 2).sum(axis=1)
        pose = state.pose.copy()
        pose[:, 2] += values["k"] * square / max(float(square.max()), 1e-9)
        return replace(state, pose=pose)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
