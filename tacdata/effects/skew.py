"""Axes of the guide are not at right angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Skew(Effect):
    """Axes of the guide are not at right angles."""

    title = "Axes of the guide are not at right angles"
    catalogue = ("K6",)
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    equation = "(x, y) -> (x + g y, y sqrt(1 - g^2)): y's axis leans and is as long as before"
    source = "standard form"
    experiment = "presses in the corners, with a tag in view"
    form_error = 0.02
    parameters = (Parameter("g", "1", "sine of the lean", 0.02, -0.3, 0.3),)
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        pose = state.pose.copy()
        pose[:, 0] += values["g"] * pose[:, 1]
        pose[:, 1] *= np.sqrt(1 - values["g"] ** 2)
        return replace(state, pose=pose)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
