"""Periodic error of the lead screw."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class ScrewError(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    memoryless = True
    equation = "d -> d + s sin(2 pi d / p) + c cos(2 pi d / p) - c, p no longer than the stroke"
    experiment = "slow presses over several turns of the screw: the residual repeats with the commanded depth"
    parameters = (
        Parameter("s", "mm", "sine part", 0.01, -0.2, 0.2),
        Parameter("c", "mm", "cosine part", 0.01, -0.2, 0.2),
        Parameter("p", "mm", "pitch", 0.5, 0.1, 8.0, grid=(0.2, 0.3, 0.5, 1.0, 2.0)),
    )
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        # Less than a period is no more a screw's than any other curve.
        angle = 2 * np.pi * state.depth / np.minimum(values["p"], state.course.stroke)
        # The cosine less 1, so that the zero of depth stays where it was touched off.
        return state.deeper(values["s"] * np.sin(angle) + values["c"] * (np.cos(angle) - 1))
