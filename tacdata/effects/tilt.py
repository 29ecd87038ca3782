"""The skin's face is not parallel to the guide."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Tilt(Effect):
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    memoryless = True
    equation = "d -> d + a x + b y"
    experiment = "touch off at three corners"
    form_error = 0.02
    parameters = (
        Parameter("a", "mm/mm", "slope along x", 0.01, -0.2, 0.2),
        Parameter("b", "mm/mm", "slope along y", 0.01, -0.2, 0.2),
    )

    def apply(self, state: State, values: Values) -> State:
        x, y, depth = state.pose.T
        # To first order: at slopes of a few per cent x and y move by far less than a taxel.
        return state.with_pose(np.stack([x, y, depth + values["a"] * x + values["b"] * y], axis=-1))
