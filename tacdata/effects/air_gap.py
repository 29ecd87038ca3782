"""Air between protrusions and taxels."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class AirGap(Effect):
    stage = "taxel"
    moves = ("signal",)
    group = "depth offset"
    family = Family.CONTACT
    memoryless = True
    equation = "s_i = max(0, s_i - g_i) above idle"
    experiment = "approach every taxel slowly: over air the onset is late, and readings rise slowly at first"
    parameters = (Parameter("g", "1", "lost share of the channel's largest rise", 0.03, 0.0, 0.6, per_channel=True),)
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        rise = state.rise
        lost = values["g"] * np.abs(rise).max(axis=0)
        # Readings of some sensors fall under load: the sign of the rise is kept.
        return state.with_rise(np.sign(rise) * np.maximum(np.abs(rise) - lost, 0.0))
