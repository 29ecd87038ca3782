"""The frame gives way under load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter

STEPS = 5
"""Fixed-point steps, each half way: a frame that gives 0.3 of the depth is right within 1 % of it [1]."""


def given_way(self: Effect, state: State, values: dict[str, np.ndarray]) -> State:
    """Return the state after a frame gave way under load: by c where the force that is reached is largest.

    Where only readings are known, the force goes with a power 1 / m of them.
    """
    tool, pose, power = state.course.tool, state.pose, 1 / float(values.get("m", 1.0))
    load = np.maximum(state.response.force(pose, tool), 0.0)
    for _ in range(STEPS):
        share = load / max(float(load.max()), 1e-12)
        pose = state.pose - np.array([0.0, 0.0, 1.0]) * (values["c"] * share**power)[:, None]
        load = 0.5 * (load + np.maximum(state.response.force(pose, tool), 0.0))
    return replace(state, pose=pose)


class FrameCompliance(Effect):
    """The frame gives way under load."""

    title = "The frame gives way under load"
    catalogue = ("K10", "G13")
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth curvature"
    family = Family.KINEMATICS
    in_series = True
    equation = "d = z - c F(d) / max F(d), by fixed-point steps"
    source = "Oliver & Pharr, J. Mater. Res. 7 (1992) 1564: h = z - F C_f"
    experiment = (
        "press a rigid block; two radii at equal depth; a tag above the compliance does not see it, one below does"
    )
    parameters = (Parameter("c", "mm per largest force", "deflection at the largest force", 0.05, 0.0, 2.0),)

    apply = given_way

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "without a model of force it cannot be told from the response itself" if response.fitted else ""
