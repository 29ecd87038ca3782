"""Depth zero changes between sessions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class SessionZero(Effect):
    """Depth zero changes between sessions."""

    title = "Depth zero changes between sessions"
    catalogue = ("K18", "E5")
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz (session - mean session)"
    source = "standard form"
    experiment = "home and touch off several times"
    form_error = 0.02
    parameters = (Parameter("dz", "mm", "from one session to the next", 0.05, -1.0, 1.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        number = state.course.session[state.course.episode].astype(float)
        shift = values["dz"] * (number - number.mean())
        return replace(state, pose=state.pose + np.array([0.0, 0.0, 1.0]) * shift[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a single session" if course.session.max() < 1 else ""
