"""Gain settles after power-on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Growth, Parameter


class SettlingGain(Effect):
    """Gain settles after power-on."""

    title = "Gain settles after power-on"
    catalogue = ("T25", "M13")
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s (1 + k exp(-t / tau)) above idle"
    source = "first-order approach to the temperature at work"
    experiment = "the same press all through the session; a reference capacitor beside it tells electronics from skin"
    parameters = (
        Parameter("k", "1", "relative change since the first recording", 0.05, -1.5, 1.5),
        Parameter("tau", "s", "time constant", 600.0, 20.0, 20000.0, grid=(200.0, 1500.0)),
    )
    follows_clock = True
    grows_with = Growth.TIME
    mechanism = "gain_drift"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        more = values["k"] * np.exp(-state.course.time / values["tau"])
        return replace(state, signal=idle + (state.signal - idle) * (1 + more)[:, None])
