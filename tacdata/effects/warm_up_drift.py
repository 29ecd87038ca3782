"""Readings settle after power-on."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class WarmUpDrift(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s + a exp(-t / tau), equal in all channels"
    experiment = "readings without contact from power-on"
    parameters = (
        Parameter("a", "largest rise", "at power-on", 0.02, -5.0, 5.0),
        Parameter("tau", "s", "time constant", 300.0, 20.0, 20000.0, grid=(60.0, 300.0, 1500.0)),
    )
    follows_clock = True

    def apply(self, state: State, values: Values) -> State:
        # By the largest rise, so that a is a share whatever the unit of the readings.
        scale = state.response.largest(state.signal)
        settling = values["a"] * np.exp(-state.course.time / values["tau"])
        return state.with_signal(state.signal + scale * settling[:, None])
