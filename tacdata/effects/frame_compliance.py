"""The frame gives way under load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Parameter


def given_way(self: Effect, state: State, values: dict[str, np.ndarray]) -> State:
    """Return the state after a frame gave way under load."""
    tool = state.course.tool
    rigid = state.response.force(state.pose, tool)
    largest = max(float(np.abs(rigid).max()), 1e-12)
    pose, load = state.pose, rigid
    for _ in range(3):
        pose = state.pose - np.array([0.0, 0.0, 1.0]) * (values["c"] * np.maximum(load, 0) / largest)[:, None]
        load = 0.5 * load + 0.5 * state.response.force(pose, tool)
    return replace(state, pose=pose)


class FrameCompliance(Effect):
    """The frame gives way under load."""

    title = "The frame gives way under load"
    catalogue = ("K10", "G13")
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth curvature"
    equation = "d = z - F(d) / K, by three fixed-point steps"
    source = "Oliver & Pharr, J. Mater. Res. 7 (1992) 1564: h = z - F C_f"
    experiment = (
        "press a rigid block; two radii at equal depth; a tag above the compliance does not see it, one below does"
    )
    parameters = (Parameter("c", "mm per largest force", "deflection at the largest force", 0.05, 0.0, 2.0),)

    apply = given_way

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot tell of it; empty if they may."""
        return "without a model of force it cannot be told from the response itself" if response.fitted else ""
