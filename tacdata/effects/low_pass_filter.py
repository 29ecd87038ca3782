"""A first-order filter in the readout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import low_pass_between
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class LowPassFilter(Effect):
    """A first-order filter in the readout."""

    title = "A first-order filter in the readout"
    catalogue = ("T9",)
    stage = "readout"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "low-pass filter"
    equation = "tau s' + s = s_e"
    source = "standard form"
    experiment = "edges: a filter rounds them, a delay keeps their shape; spectrum of noise without contact"
    parameters = (Parameter("tau", "s", "time constant", 0.05, 0.0, 2.0),)
    at_rest = AtRest.CATCHES_UP

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        tau = float(values["tau"])
        if tau <= 0.0:
            return state
        start = state.signal[:1]
        return replace(state, signal=start + low_pass_between(state.signal - start, state.course.step, tau))
