"""The skin stiffens with depth."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Stiffening(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "q = q_e (1 + k d / D), D the deepest depth"
    source = "second term of a series in strain; Yeoh, Rubber Chem. Technol. 66 (1993) 754"
    experiment = (
        "presses with two indenters: a law of the taxel is the same over readings, one of the skin over depth by radius"
    )
    parameters = (Parameter("k", "1", "stiffer at the deepest depth", 0.1, -0.9, 3.0),)

    def apply(self, state: State, values: Values) -> State:
        # Over the deepest depth, so that k is a share that was reached.
        more = 1 + values["k"] * np.maximum(state.depth, 0.0) / state.course.span
        return state.scaled(more)
