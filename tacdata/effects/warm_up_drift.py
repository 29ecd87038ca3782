"""Readings settle after power-on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Parameter


class WarmUpDrift(Effect):
    """Readings settle after power-on."""

    title = "Readings settle after power-on"
    catalogue = ("E2", "T12")
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s + a exp(-t / tau), alike in all channels"
    source = "standard form"
    experiment = "readings without contact from power-on"
    parameters = (
        Parameter("a", "largest rise", "at power-on", 0.02, -5.0, 5.0),
        Parameter("tau", "s", "time constant", 300.0, 20.0, 20000.0, grid=(60.0, 300.0, 1500.0)),
    )
    follows_clock = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        scale = state.response.largest(state.signal)
        settling = values["a"] * np.exp(-state.course.time / values["tau"])
        return replace(state, signal=state.signal + scale * settling[:, None])
