"""Axes of the guide are not at right angles."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Skew(Effect):
    stage = "kinematics"
    moves = ("tag", "label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    memoryless = True
    equation = "(x, y) -> (x + g y, y sqrt(1 - g^2)): y's axis leans and is as long as before"
    experiment = "presses in the corners, with a tag in view"
    form_error = 0.02
    parameters = (Parameter("g", "1", "sine of the lean", 0.02, -0.3, 0.3),)
    seen_by_tag = True

    def apply(self, state: State, values: Values) -> State:
        pose = state.pose.copy()
        pose[:, 0] += values["g"] * pose[:, 1]
        pose[:, 1] *= np.sqrt(1 - values["g"] ** 2)
        return state.with_pose(pose)
