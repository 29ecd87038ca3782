"""The skin does not rest on its support."""

from dataclasses import replace

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class SeatingGap(Effect):
    stage = "contact"
    moves = ("label", "signal")
    group = "depth offset"
    family = Family.CONTACT
    memoryless = True
    equation = "q = max(0, q_e - g largest q_e)"
    experiment = "touch off all over the skin: a zero error is the same everywhere, a gap is a dome"
    parameters = (Parameter("g", "1", "share of the largest load needed to close it", 0.02, 0.0, 0.5),)

    def apply(self, state: State, values: Values) -> State:
        lost = values["g"] * np.abs(state.load).max()
        return replace(state, load=np.sign(state.load) * np.maximum(np.abs(state.load) - lost, 0.0))
