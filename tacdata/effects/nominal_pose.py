"""The simulation was run at the commanded pose, not the measured one."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class NominalPose(Effect):
    stage = "simulator"
    moves = ("label", "signal")
    group = "simulator"
    family = Family.SIMULATION
    equation = "pose -> pose + k (tag - commanded)"
    experiment = "simulate again at the measured pose"
    parameters = (Parameter("k", "1", "share of the measured difference", 0.5, 0.0, 1.5),)

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        # Where no tag was seen the command is all that is known.
        tag = course.tip if course.tag is None else np.where(np.isfinite(course.tag), course.tag, course.tip)
        pose = state.pose + values["k"] * (tag - course.tip)
        load = state.response.load(pose, course.tool) - state.response.load(state.pose, course.tool)
        # As a change of readings: the simulation is off, whatever other effects do.
        change = state.response.signal(state.load + load) - state.response.signal(state.load)
        return state.with_signal(state.signal + change)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "no second observation of the pose (tag) was recorded" if course.tag is None else ""
