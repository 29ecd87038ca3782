"""Readings level off."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Saturation(Effect):
    stage = "taxel"
    moves = ("signal",)
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "s = s / (1 + k |s| / S) above idle, S the largest"
    experiment = "deeper presses, and a histogram: readings pile up at one value, whatever the depth"
    parameters = (Parameter("k", "1", "loss at the largest reading", 0.1, 0.0, 5.0),)

    def apply(self, state: State, values: Values) -> State:
        rise = state.rise
        # To zero loss at small readings, so that it is no gain.
        return state.with_rise(rise / (1 + values["k"] * np.abs(rise) / max(np.abs(rise).max(), 1e-12)))
