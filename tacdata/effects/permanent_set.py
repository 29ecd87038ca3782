"""The skin keeps a dent where it was pressed."""

from dataclasses import replace

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class PermanentSet(Effect):
    stage = "mechanics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.SKIN_MEMORY
    equation = "d -> d - e D_k / D (1 - exp(-k / n)), k presses before at that place, D_k the deepest of them"
    experiment = "return to a place after a long rest; compare with one never pressed"
    parameters = (
        Parameter("e", "mm", "final dent", 0.03, 0.0, 0.5),
        Parameter("n", "1", "presses until most of it is there", 3.0, 0.3, 100.0, grid=(1.0, 5.0, 25.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        depth = np.maximum(state.depth, 0.0)
        deepest = np.zeros(course.episodes)
        np.maximum.at(deepest, course.episode, depth)
        dent = np.zeros(course.episodes)
        for k in range(course.episodes):
            # Only presses before this one have left a dent.
            same = np.flatnonzero(course.site[:k] == course.site[k])
            if len(same):
                dent[k] = -np.expm1(-len(same) / values["n"]) * deepest[same].max() / course.span
        shallower = state.deeper(-values["e"] * dent[course.episode]).pose
        response, tool = state.response, course.tool
        # As a difference, so that changes of the load by other effects remain.
        load = response.load(shallower, tool) - response.load(state.pose, tool)
        force = response.force(shallower, tool) - response.force(state.pose, tool)
        return replace(state, load=state.load + load, force=state.force + force)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "no place was pressed twice" if len(set(course.site.tolist())) == course.episodes else ""
