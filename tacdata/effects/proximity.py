"""The indenter is felt before it touches."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class Proximity(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "depth offset"
    family = Family.CONTACT
    memoryless = True
    equation = "s_i = s_i + a w_i exp(d / l) for d < 0, w_i by the pattern at a tenth of the deepest depth"
    experiment = "plastic against metal indenter, grounded or not"
    parameters = (
        Parameter("a", "1", "rise at touch over that at a tenth of the depth", 0.2, -10.0, 10.0),
        Parameter("l", "mm", "range", 0.5, 0.05, 10.0, grid=(0.2, 1.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        # Before touch the response has no pattern: that of a light touch stands for it.
        pose = state.pose.copy()
        pose[:, 2] = 0.1 * state.course.span
        pattern = state.response.signal(state.response.load(pose, state.course.tool)) - state.idle
        # In contact it stays at its value of the touch.
        near = np.exp(np.minimum(state.depth, 0.0) / values["l"])
        return state.with_signal(state.signal + values["a"] * near[:, None] * pattern)

    def unjudgeable(self, course: Course, response: Response) -> str:
        if response.fitted:
            return "a fitted response takes up whatever has no memory"
        return "nothing was recorded before touch" if course.tip[:, 2].min() > -0.05 else ""
