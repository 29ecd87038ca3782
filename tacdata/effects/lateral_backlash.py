"""Play of the lateral drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import dead_band
from tacdata.effects.effect import Effect, Family, Parameter


class LateralBacklash(Effect):
    """Play of the lateral drives."""

    title = "Play of the lateral drives"
    catalogue = ("K7",)
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "lateral"
    family = Family.FRICTION_AND_PLAY
    equation = "x = play_{b/2}(x), y = play_{b/2}(y): half the play aside of the command, on the side it came from"
    source = "play operator"
    experiment = "the same place approached from +x, -x, +y, -y"
    parameters = (Parameter("b", "mm", "play", 0.05, 0.0, 0.6),)
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        half = 0.5 * float(values["b"])
        if half == 0.0:
            return state
        pose = state.pose.copy()
        for axis in (0, 1):
            pose[:, axis] += dead_band(pose[:, axis], half, float(state.course.dithers[axis]))
        return replace(state, pose=pose)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
