"""The chip pulls every reading back to its baseline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import Effect, Family, Parameter


class BaselineTracking(Effect):
    """The chip pulls every reading back to its baseline."""

    title = "The chip pulls every reading back to its baseline"
    catalogue = ("T13",)
    stage = "readout"
    moves = ("signal",)
    group = "hold time"
    family = Family.DELAY_AND_FILTER
    equation = "b' = r (s - b), read s - b above idle: long presses decay to zero and undershoot on release"
    source = "NXP AN3891, baseline system of the MPR121"
    experiment = "switch it off; hold long: the plateau is zero, and what is lost comes back negative after release"
    parameters = (Parameter("r", "1/s", "rate", 0.01, 0.0, 3.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        rate = float(values["r"])
        if rate <= 0.0:
            return state
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        rise = state.signal - idle
        return replace(state, signal=idle + rise - low_pass(rise, state.course.step, 1 / rate))
