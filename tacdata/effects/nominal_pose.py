"""The simulation was run at the commanded pose, not the measured one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class NominalPose(Effect):
    """The simulation was run at the commanded pose, not the measured one."""

    title = "The simulation was run at the commanded pose, not the measured one"
    catalogue = ("S6",)
    stage = "simulator"
    moves = ("label", "signal", "force")
    group = "simulator"
    family = Family.SIMULATION
    equation = "pose -> pose + k (tag - commanded)"
    source = "standard form"
    experiment = "simulate again at the measured pose"
    parameters = (Parameter("k", "1", "share of the measured difference", 0.5, 0.0, 1.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        tag = course.tip if course.tag is None else np.where(np.isfinite(course.tag), course.tag, course.tip)
        moved = state.pose + values["k"] * (tag - course.tip)
        load = state.response.load(moved, course.tool) - state.response.load(state.pose, course.tool)
        change = state.response.signal(state.load + load) - state.response.signal(state.load)
        return replace(state, signal=state.signal + change)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "no second observation of the pose (tag) was recorded" if course.tag is None else ""
