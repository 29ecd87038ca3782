"""Wrong steps per millimetre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter, Scale


class TravelScale(Effect):
    """Wrong steps per millimetre."""

    title = "Wrong steps per millimetre"
    catalogue = ("K5",)
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "amplitude"
    family = Family.KINEMATICS
    equation = "(x, y, d) -> (1 + k) (x, y, d)"
    source = "standard form"
    experiment = "a gauge block, or a tag, over a long travel"
    form_error = 0.02
    parameters = (Parameter("k", "1", "relative error of travel", 0.02, -0.3, 0.3),)
    scale = Scale.DRIVE
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        return replace(state, pose=state.pose * (1 + values["k"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
