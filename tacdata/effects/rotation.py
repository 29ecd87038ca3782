"""Rotation of the sensor against the guide."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Rotation(Effect):
    stage = "kinematics"
    moves = ("label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    memoryless = True
    equation = "(x, y) -> (x cos theta - y sin theta, y cos theta + x sin theta)"
    experiment = "presses far from the centre at all four corners"
    form_error = 0.02
    parameters = (Parameter("theta", "rad", "turn about z", 0.02, -0.3, 0.3),)

    def apply(self, state: State, values: Values) -> State:
        x, y, depth = state.pose.T
        cosine, sine = np.cos(values["theta"]), np.sin(values["theta"])
        return state.with_pose(np.stack([cosine * x - sine * y, cosine * y + sine * x, depth], axis=-1))
