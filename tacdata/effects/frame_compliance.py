"""The frame gives way under load."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values
from tacdata.effects.relaxation import POWER

STEPS = 5
"""Fixed-point steps, each half way: a frame that gives 0.3 of the depth is right within 1 % of it [1]."""


def given_way(self: Effect, state: State, values: Values) -> State:
    """Return the state after the deflection of a frame under load: c at the largest force that is reached.

    If only readings are known, the force is their power 1 / m.
    """
    tool, pose, power = state.course.tool, state.pose, 1 / float(values.get("m", 1.0))
    load = np.maximum(state.response.force(pose, tool), 0.0)
    for _ in range(STEPS):
        # By the largest force, so that the compliance is a length and needs no unit of force.
        share = load / max(float(load.max()), 1e-12)
        pose = state.deeper(-values["c"] * share**power).pose
        # Half steps: where the frame is softer than the skin, whole ones swing.
        load = 0.5 * (load + np.maximum(state.response.force(pose, tool), 0.0))
    return state.with_pose(pose)


class FrameCompliance(Effect):
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
        return "without a model of force it cannot be distinguished from the response itself" if response.fitted else ""


class CarriageCompliance(FrameCompliance):
    """The frame gives way under load, and the tag with it."""

    in_series = False

    moves = ("tag", "label", "signal", "force")
    equation = "d = z - c F(d) / max F(d), by fixed-point steps; seen by the tag"
    experiment = "press a rigid block while the tag is in view"
    seen_by_tag = True

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "no tag was seen" if course.tag is None else ""


class CarriageComplianceRead(CarriageCompliance):
    """The frame gives way under load, and the tag with it."""

    equation = "d = z - c (r(d) / max r(d))^(1/m), r the root mean square of the readings; seen by the tag"
    parameters = (Parameter("c", "mm per largest force", "deflection at the largest force", 0.05, 0.0, 2.0), POWER)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return super().unjudgeable(course, response) or ("the force is known" if course.force is not None else "")
