"""Periodic error of the lead screw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class ScrewError(Effect):
    """Periodic error of the lead screw."""

    title = "Periodic error of the lead screw"
    catalogue = ("K8",)
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + s sin(2 pi d / p) + c cos(2 pi d / p) - c, p no longer than the stroke"
    source = "standard form"
    experiment = "slow presses over several turns of the screw: the residual repeats with the commanded depth"
    parameters = (
        Parameter("s", "mm", "sine part", 0.01, -0.2, 0.2),
        Parameter("c", "mm", "cosine part", 0.01, -0.2, 0.2),
        Parameter("p", "mm", "pitch", 0.5, 0.1, 8.0, grid=(0.2, 0.3, 0.5, 1.0, 2.0)),
    )
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        # Less than a period is no more a screw's than any other curve.
        angle = 2 * np.pi * state.depth / np.minimum(values["p"], state.course.stroke)
        pose = state.pose.copy()
        pose[:, 2] += values["s"] * np.sin(angle) + values["c"] * (np.cos(angle) - 1)
        return replace(state, pose=pose)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
