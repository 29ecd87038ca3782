"""Readings rise ever faster as the gap closes."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class GapCurvature(Effect):
    stage = "taxel"
    moves = ("signal",)
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "s = s + k s^2 / S above idle, S the largest"
    source = "parallel plate: C = eps A / (g - u)"
    experiment = "presses with two indenters: a curve of the taxel is the same over readings, one of the skin is not"
    parameters = (Parameter("k", "1", "excess at the largest reading", 0.1, 0.0, 3.0),)

    def apply(self, state: State, values: Values) -> State:
        rise = state.rise
        # With the sign of the rise: readings of some sensors fall under load.
        return state.with_signal(state.idle + rise + values["k"] * rise * np.abs(rise) / max(np.abs(rise).max(), 1e-12))
