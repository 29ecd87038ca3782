"""Wrong scale of a second observation of the tip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter, Scale


class ViewScale(Effect):
    """Wrong scale of a second observation of the tip."""

    title = "Wrong scale of the camera, or the gauge, that sees the tip"
    catalogue = ("K19",)
    stage = "view"
    moves = ("tag",)
    group = "amplitude"
    family = Family.KINEMATICS
    equation = "what is seen of (x, y, d) is (1 + s) (x, y, d)"
    source = "standard form"
    experiment = "a gauge block, or a second camera: what one of two observers sees wrong, readings do not follow"
    form_error = 0.02
    seen_by_tag = True
    parameters = (Parameter("s", "1", "relative error of lengths seen", 0.01, -0.3, 0.3),)
    scale = Scale.OBSERVER

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        return replace(state, view=state.view * (1 + values["s"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "" if course.tag is not None else "nothing but the command says where the tip is"
